"""What the rows of a session say for terms of a model that follow them, and why not."""

from dataclasses import dataclass

from calib.geometry.operating import OperatingConditions

UNKNOWN = "the order of the poses is not known"
NO_TORQUES = "the file has no such columns"


@dataclass(frozen=True, slots=True, eq=False)
class RowsSay:
    """What rows say for the terms of a model, and why not where they do not."""

    drive: str = ""
    """torque or current; empty where no file has any."""
    unsaid: tuple[tuple[str, str], ...] = (("approach", UNKNOWN), ("torque", NO_TORQUES))
    """Cause of joint errors and why it cannot be told."""


NOTHING_SAID = RowsSay()
"""Of a session that says nothing of the kind."""


def taken_as_usual(said: OperatingConditions, silent: OperatingConditions) -> tuple[str, ...]:
    """What held-out rows do not say of what the others say, and how they are taken then."""
    words = {
        "approach": "the order of the held-out rows is not known, unlike that of the others: if "
        "the model includes backlash, they are placed in the middle of it",
        "torque": "the held-out rows have no torques of the drives, unlike the others: the mean "
        "of these is used",
    }
    return tuple(
        text for name, text in words.items() if name in said.stated and name not in silent.stated
    )
