"""One BLAS thread before numpy is imported: results must not depend on the machine's cores."""

import os
from typing import Any

import pytest

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ.setdefault("MUJOCO_GL", "disable")

from hypothesis import settings  # noqa: E402 - numpy may be imported from here on

# a machine under load is slow, not wrong
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")

APART = "test_scenes.py"
"""A file of long tests that share nothing: each may run on its own."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep the tests of a file in one process: what they play together is played once."""
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            scope = super()._split_scope(nodeid)
            return nodeid if scope.endswith(APART) else scope

    return ByFile(config, log)
