"""The command `truebed`: prepares the process, then hands over to the verbs."""

import gc
import os
import sys
from contextlib import suppress

from calib.errors import MachineError
from testbed.machine import LOOKING, lacking, require_room

ENVIRONMENT = {
    # one BLAS thread: sums keep their order, so the same scenario gives the same bytes
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    # MuJoCo computes only; without this its import loads a window library
    "MUJOCO_GL": "disable",
    "MPLBACKEND": "agg",
    # pydantic asks every installed package for plugins otherwise; none has a use here
    "PYDANTIC_DISABLE_PLUGINS": "1",
}
"""Set before numpy is imported; the libraries themselves never touch the environment."""
MACHINE = 3
COLLECTED_AFTER = 10_000
"""New containers after which Python looks for circles of garbage, of which there are few here: with
its own default, a run spends a fourteenth of its time on looking."""


def main() -> None:
    """Run the command line and end the process with its exit code."""
    os.environ.update(ENVIRONMENT)
    gc.set_threshold(COLLECTED_AFTER)
    try:
        require_room(LOOKING)
        from testbed.cli.app import answer
        from testbed.cli.output import open_streams

        open_streams()
        sys.exit(answer())
    except (OSError, MachineError, ImportError) as error:  # help and version end here
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if isinstance(error, BrokenPipeError):
            return
        if isinstance(error, OSError):
            where = str(error.filename or "stdout")  # a file where --install-completion writes
            error = MachineError(f"cannot be written: {error.strerror}", code="F3", where=where)
        elif isinstance(error, ImportError):
            if (lack := lacking(error)) is None:
                raise
            error = lack
        with suppress(OSError):
            os.write(2, f"{error}\n".encode())
        sys.exit(MACHINE)


if __name__ == "__main__":
    main()
