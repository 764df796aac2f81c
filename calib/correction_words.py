"""What corrections of targets came to, in words."""

from collections.abc import Mapping, Sequence

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel


def few_joints(model: RobotModel, held: int = 0) -> bool:
    """Whether an arm has fewer than six joints, not counting `held` ones that do not move."""
    return model.chain.n_joints - held < 6


def turned_sentences(
    model: RobotModel, status: Sequence[str], left: Array, held: int = 0
) -> tuple[str, ...]:
    """Sentence on the rotation `left` (m,) [rad] by an arm of fewer than six joints, `held` out."""
    reached = np.array([one == "reached" for one in status], dtype=np.bool_)
    if not few_joints(model, held) or not reached.any():
        return ()
    n = model.chain.n_joints - held
    most, free = np.degrees(left[reached].max()), "free " * bool(held)
    return (
        f"an arm with {n} {free}joint{'s' if n > 1 else ''} cannot orient its tool freely: "
        f"targets are reached with the tool point, and up to {most:.2g} deg of the rotation "
        "remains",
    )


WORDS: Mapping[str, str] = {
    "singular": "corrected in a nearly singular posture, where a small turn of the tool needs a "
    "large move of the joints; check the corrected joints, or move the target",
    "limits": "reached only outside the joint limits; the nearest posture inside is given",
    "out of reach": "not reached by the identified robot in a posture near the given one; the "
    "nearest posture is given",
}


def status_sentences(
    status: Sequence[str], words: Mapping[str, str] = WORDS, *, names: Sequence[str] = ()
) -> tuple[str, ...]:
    """One sentence for each kind of trouble, with the rows concerned by `names`, else from 1."""
    names = names or [str(k + 1) for k in range(len(status))]
    said = []
    for outcome, meaning in words.items():
        rows = [name for name, one in zip(names, status, strict=True) if one == outcome]
        if rows:
            listed = ", ".join(rows[:10]) + (" ..." if len(rows) > 10 else "")
            many = len(rows) > 1
            said.append(
                f"{len(rows)} of {len(status)} targets {'are' if many else 'is'} {meaning} "
                f"(target{'s' if many else ''} {listed})"
            )
    return tuple(said)
