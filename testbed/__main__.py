"""The command `truebed`: prepares the process, then hands over to the verbs."""

import os
import sys

ENVIRONMENT = {
    # one BLAS thread: sums keep their order, so the same scenario gives the same bytes
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    # MuJoCo computes only; without this its import loads a window library
    "MUJOCO_GL": "disable",
    "MPLBACKEND": "agg",
}
"""Set before numpy is imported; the libraries themselves never touch the environment."""
MACHINE = 3


def main() -> None:
    """Run the command line and end the process with its exit code."""
    os.environ.update(ENVIRONMENT)
    from testbed.cli import app

    try:
        app(prog_name="truebed", windows_expand_args=False)
    except OSError as error:  # the help text itself could not be written
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if not isinstance(error, BrokenPipeError):
            os.write(2, f"stdout: cannot be written: {error.strerror}. [F3]\n".encode())
            sys.exit(MACHINE)


if __name__ == "__main__":
    main()
