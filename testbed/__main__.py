"""The command `truebed`: prepares the process, then hands over to the verbs."""

import os

ENVIRONMENT = {
    # one BLAS thread: sums keep their order, so the same scenario gives the same bytes
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    # MuJoCo computes only; without this its import loads a window library
    "MUJOCO_GL": "disable",
    "RERUN_ANALYTICS_ENABLED": "false",
    "MPLBACKEND": "agg",
}
"""Set before numpy is imported; the libraries themselves never touch the environment."""


def main() -> None:
    """Run the command line and end the process with its exit code."""
    os.environ.update(ENVIRONMENT)
    from testbed.cli import app

    app(prog_name="truebed", windows_expand_args=False)


if __name__ == "__main__":
    main()
