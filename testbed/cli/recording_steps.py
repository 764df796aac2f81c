"""The steps of a recording, read from its file: where its phases begin, and which is the last."""

import warnings
from pathlib import Path

import numpy as np

from calib.errors import refuse
from testbed.units import listed


def phases_of(rrd: Path) -> tuple[dict[str, int], int]:
    """First step of each phase of a recording, by the phase's name, and the last step of all.

    Raises
    ------
    InputError
        F3: it is no recording, or is not whole.
    """
    from rerun.chunk import RrdReader

    begins, last = dict[str, int](), 0
    try:
        with warnings.catch_warnings(action="ignore"):  # of what is raised as an error, too
            chunks = list(RrdReader(str(rrd)).store().stream())
    except (OSError, RuntimeError, ValueError) as error:  # whatever is wrong with the file
        message, fix = "is not a recording, or is incomplete", "write it again: truebed record RUN"
        raise refuse("rrd", code="F3", message=message, fix=fix, where=str(rrd)) from error
    for chunk in chunks:
        batch = None if chunk.is_static else chunk.to_record_batch()
        if batch is None or "step" not in batch.schema.names:
            continue
        steps = np.asarray(batch["step"]).astype(np.int64)
        last = max(last, int(steps.max()))
        if chunk.entity_path == "/phase":
            names = (cell[0] for cell in batch["StateChange:state"].to_pylist())
            begins |= dict(zip(names, steps.tolist(), strict=True))
    return dict(sorted(begins.items(), key=lambda item: item[1])), last


def step_of(rrd: Path, wanted: int | None) -> int:
    """The step that is wanted, the last one if none is; C41 if the recording does not have it."""
    begins, last = phases_of(rrd)
    step = last if wanted is None else wanted
    if not 0 <= step <= last:
        firsts = listed([f"{name} from {first}" for name, first in begins.items()])
        raise refuse(
            "--step", step, code="C41", message=f"--step is {step}",
            allowed=f"steps run from 0 to {last}: {firsts}" if begins else f"from 0 to {last}",
            fix="choose one of them",
        )  # fmt: skip
    return step
