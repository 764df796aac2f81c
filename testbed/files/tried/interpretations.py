"""Interpretations of a file that were tried, what each leaves, and whether the stated one holds."""

from dataclasses import dataclass

import numpy as np

from calib.errors import InputError
from testbed.files.alternatives import Alternative
from testbed.files.frames_fit import FAR, TIMES, Misfit
from testbed.files.refusal import refusal
from testbed.files.rows.shifts import FEWEST
from testbed.files.tried.links_fit import ANGLE, FARTHEST, LENGTH, LinksFit
from testbed.units import counted

ALIKE = 2.0
"""An alternative of few rows leaves so many times less than as many beside their own joints. Of
900 random lines of ten good rows one is named so and nine were without it; of 400 with shifted rows
193, as without it."""
WAY = "other interpretation"
ABSURD = 1.0
"""What is left by more than this is no size of an error, but of nothing that fits [m]."""
UNITS = (0.6, 1.6)
"""Spread of the measured positions over the nominal ones, with the right unit."""
BEYOND = 5.0
"""Times outside of that from which on a few poses show a wrong unit: inches for mm are 25."""


@dataclass(frozen=True, slots=True)
class Tried:
    """An alternative reading and what it leaves."""

    alternative: Alternative
    misfit: Misfit
    beside: float | None = None
    """Score that as many rows leave as they were read, where it is of fewer than all [m]."""
    linked: LinksFit | None = None
    """Links that explain what base and tool alone leave of it, where these were asked."""


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """What the stated reading leaves, and what others would."""

    where: str
    robot: str
    stated: Misfit | None = None
    """None if there are too few poses to judge."""
    tried: tuple[Tried, ...] = ()
    """Best first."""
    spread: float = float("nan")
    """Spread of measured over nominal positions; nan for distances."""
    warnings: tuple[str, ...] = ()
    no_target: InputError | None = None
    """Where two targets cannot both have been on the tool."""
    far: float = FAR
    """Error that the right reading of an arm near nominal never leaves [m]."""
    linked: LinksFit | None = None
    """Links that explain what base and tool alone leave of the stated reading."""
    moved_at: str = ""
    """Row from which on it has frames of its own, where that explains it."""
    exact: bool = False
    """Whether base and tool explain it as exactly as a controller's own poses."""

    @property
    def best(self) -> Tried | None:
        """The alternative that fits best."""
        return self.tried[0] if self.tried else None

    @property
    def wrong(self) -> Tried | None:
        """The alternative that fits so much better that the file is read wrongly."""
        if self.stated is None or self.linked is not None:
            return None
        return next((one for one in self.tried if self._is_better(one, self.stated)), None)

    def _is_better(self, one: Tried, stated: Misfit) -> bool:
        """Whether another reading fits while the stated one does not."""
        if one.linked is not None:
            return True
        # what is better and still absurd is no reading of this file either
        if one.misfit.score > FAR or stated.score <= TIMES * one.misfit.score:
            return False
        return one.beside is None or one.beside > ALIKE * one.misfit.score

    @property
    def sentence(self) -> str:
        """The fit of the stated reading and of the best other one in words."""
        if self.stated is None:
            return f"too few poses to try other interpretations of the file; at least {FEWEST}"
        sentence = f"with only base and tool fitted, the errors are {self.stated.shown}"
        if self.linked is not None:
            sentence += f"; {self.linked.sentence}"
        if self.best is None:
            return sentence
        count, left = len(self.tried), self.best.misfit
        if left.score > ABSURD:
            return f"{sentence}; none of {counted(count, WAY)} comes near the robot"
        return f"{sentence}; with the best of {count} other interpretations, {left.shown}"

    def _absurd(self, stated: Misfit, least: Misfit) -> str:
        """How far off the readings are however they are interpreted."""
        text = f"with base and tool fitted, the readings miss the robot by {stated.shown}"
        if not np.isfinite(stated.score):
            text = "no base and tool bring the readings near the robot"
        if least.score > ABSURD:
            return f"{text}, and none of {counted(len(self.tried), WAY)} comes near it"
        return f"{text}, and by {least.shown} or more however the file is interpreted"

    def raise_if_wrong(self) -> None:
        """Refuse a file that is read wrongly, or that is not of this robot.

        Raises
        ------
        InputError
            The code of the row it belongs to; the message names the reading that fits.
        """
        stated, wrong = self.stated, self.wrong
        if stated is None:
            if np.isfinite(self.spread) and not UNITS[0] / BEYOND < self.spread < UNITS[1] * BEYOND:
                raise refusal(
                    self.where, "length",
                    f"the measured points spread {self.spread:.3g} times as far as the robot moves",
                    code="M21", value=self.spread,
                    allowed=f"{UNITS[0]} to {UNITS[1]} times is usual",
                    fix="check the unit of the positions",
                )  # fmt: skip
        elif wrong is not None:
            other = wrong.alternative
            raise refusal(
                self.where, other.field,
                f"with base and tool fitted, the readings miss the robot by {stated.shown}, but "
                f"only by {wrong.misfit.shown} {other.condition}"
                + (f", and {wrong.linked.sentence}" if wrong.linked is not None else ""),
                code=other.code, value=stated.position, fix=other.fix,
            )  # fmt: skip
        elif self.no_target is not None:
            raise self.no_target
        elif stated.score > self.far and self.linked is None:
            if self.moved_at:
                raise refusal(
                    self.where, "session",
                    f"with base and tool fitted, the readings miss the robot by {stated.shown}, "
                    "but not if the instrument, the robot or the target on its flange was moved "
                    f"just before {self.moved_at}: what comes before fits, and so does the rest, "
                    "each with frames of its own", code="M32", value=stated.position,
                    fix='describe the rows from there on as a [[session]] of their own, tool = '
                    '"same as" the first if the target stayed on the flange, base = "same as" it '
                    "if the instrument and the robot stayed",
                )  # fmt: skip
            every = [stated, *(one.misfit for one in self.tried)]
            least = min(every, key=lambda one: one.score)
            raise refusal(
                self.where, "ROBOT",
                self._absurd(stated, least), code="M32",
                value=stated.position,
                allowed=f"links of a {self.robot} that are up to {FARTHEST * LENGTH * 1e3:.0f} mm "
                f"and {np.degrees(FARTHEST * ANGLE):.0f} deg from nominal do not explain that",
                fix="is this the robot that was measured? if so, state in [prior] how far its "
                "links may be off",
            )  # fmt: skip
