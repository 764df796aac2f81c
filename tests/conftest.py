"""One BLAS thread before numpy is imported: results must not depend on the machine's cores."""

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ.setdefault("MUJOCO_GL", "disable")

from hypothesis import settings  # noqa: E402 - numpy may be imported from here on

# a machine under load is slow, not wrong
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")
