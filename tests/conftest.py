"""One BLAS thread before numpy is imported: results must not depend on the machine's cores."""

import gc
import os
import sys
from collections.abc import Iterator
from typing import Any

import pytest

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ.setdefault("MUJOCO_GL", "disable")
os.environ["TRUEBED_CACHE"] = ""  # how long a test takes tells nobody anything
# programs that tests start are compiled once for all, whatever the shell says
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

from hypothesis import settings  # noqa: E402 - numpy may be imported from here on

# a machine under load is slow, not wrong
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")

APART = "test_scenes.py"
"""A file of long tests that share nothing: each may run on its own."""
TOGETHER = tuple(f"tests/testbed/{room}/" for room in ("identify", "plan", "studies"))
"""Rooms whose files look at the same campaigns: what one of them plays, the others have."""

LONG = (APART, "tests/truth/", "cli/test_video.py", "cli/test_viewer.py", "tests/test_examples.py")
"""Few tests of many seconds each: they go first, so that no process waits for one at the end."""


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect with the garbage collector off: what is collected stays to the end, half a million
    objects that it would look at again and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep in one process the tests of a file, or of a room that shares what it plays."""
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _assign_work_unit(self, node: Any) -> None:
            for scope in [one for one in self.workqueue if any(name in one for name in LONG)]:
                self.workqueue.move_to_end(scope, last=False)
            super()._assign_work_unit(node)

        def _split_scope(self, nodeid: str) -> str:
            scope = super()._split_scope(nodeid)
            room = next((room for room in TOGETHER if scope.startswith(room)), scope)
            return nodeid if scope.endswith(APART) else room

    return ByFile(config, log)
