"""What the rows of a session say for terms of a model that follow them, and why not."""

from dataclasses import dataclass

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
