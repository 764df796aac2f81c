"""Decisions of a climb: which level of which ladder is next, and whether poses left out confirm it.

The evidence of models and their errors at poses left out are asked of the caller, which works them
out for one robot or for many at once.
"""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple, TypeAlias

import numpy as np

from calib.arrays import Array, FloatOrNan
from calib.geometry.model import RobotModel
from calib.identification.levels import Ladder, Level, foreseen
from calib.shown import ResultTable, Shown

ASKED = float(np.log(20))
"""Gain of log evidence from which another level is asked for: odds of 20 to 1."""
TOGETHER = 0.5
"""Standard errors by which all levels together may exceed the error of geometry at poses left out.
"""


@dataclass(frozen=True, slots=True)
class ClimbStep:
    """One level that the evidence asked for, and whether it was taken."""

    ladder: str
    level: str
    gain: float
    """Log evidence against the model before it."""
    before: FloatOrNan
    """Mean error at training poses left out in turn, of the model before it [m]; nan if there are
    too few poses to leave any out."""
    after: FloatOrNan
    """Mean error at these poses with the level [m]."""
    taken: bool
    """Whether the poses left out confirm it: not worse by more than one standard error."""


@dataclass(frozen=True, slots=True)
class Offer:
    """A level of a ladder, or the reason for a missing one, with its outcome."""

    ladder: str
    level: str
    gain: FloatOrNan
    """Log evidence against geometry alone, without any other level; nan where it is not offered."""
    outcome: str
    """taken, replaced, refused, asked for, not needed, not asked for, or not offered and why."""


@dataclass(frozen=True, slots=True, eq=False)
class Climb(Shown):
    """Result of a climb."""

    levels: tuple[Level, ...]
    """Levels reached, one of each ladder."""
    steps: tuple[ClimbStep, ...]
    """Levels that the evidence asked for, in order."""
    offers: Callable[[], tuple[Offer, ...]]
    """Function that works out the outcome of every level on offer."""
    best: tuple[str, float] | None
    """Name and gain of log evidence, against geometry alone, of the best level to begin with; None
    if there is none."""
    gain: float
    """Log evidence of the levels reached against geometry alone."""
    noise_factor: float
    """Noise that the richest model leaves, with the misfit that visits of one pose share in the
    model reached, in units of the stated noise; one or more."""
    poses: int
    """Number of poses looked at."""
    before: float
    """Mean error at these poses, left out in turn, of geometry alone [m]."""
    after: float
    """Mean error at these poses, left out in turn, of the model reached [m]."""
    near: RobotModel
    """The model reached, by the linearized equations: close to its fit."""
    richest: Callable[[], RobotModel]
    """Function that works out the same of the last level of every ladder."""

    def __repr__(self) -> str:
        return f"Climb({', '.join(level.name for level in self.taken) or 'geometry alone'})"

    def tables(self) -> dict[str, ResultTable]:
        """``levels``: log evidence of each that was offered against geometry, and its outcome."""
        names, offered = ("ladder", "level", "gain", "outcome"), self.offered
        columns = {name: [getattr(offer, name) for offer in offered] for name in names}
        return {"levels": ResultTable(columns)}

    @property
    def offered(self) -> tuple[Offer, ...]:
        """One for each level of each ladder, or for a ladder that has none."""
        return self.offers()

    @property
    def confirmed(self) -> bool:
        """Whether poses were left out to confirm anything."""
        return not np.isnan(self.before)

    @property
    def taken(self) -> tuple[Level, ...]:
        """Levels reached that are not empty."""
        return tuple(level for level in self.levels if level.names)


class Question(NamedTuple):
    """What a climb asks its caller: evidence of models, or errors of one at poses left out."""

    models: tuple[tuple[Level, ...], ...]
    """Levels of each model, one of each ladder."""
    left_out: bool
    """If true, the answer is the mean error of the one model at each pose [m], else the log
    evidence of each model."""


class Course(NamedTuple):
    """Decisions of a climb."""

    levels: tuple[Level, ...]
    """Levels reached, one of each ladder."""
    steps: tuple[ClimbStep, ...]
    """Levels that the evidence asked for, in order."""
    alone: Mapping[Level, float]
    """Log evidence against geometry alone of each level that a climb can begin with, by itself."""
    gain: float
    """Log evidence of the levels reached against geometry alone."""
    lowest: Array
    """Mean error at each pose left out, of geometry alone [m]."""
    before: Array
    """Mean error at each pose left out, of the model reached [m]."""
    margin: float
    """Smallest change of a log evidence, or of an error in units of its standard error, that would
    have changed a decision."""


Answer: TypeAlias = Sequence[float] | Array
Climbing: TypeAlias = Generator[Question, Answer, Course]


def climbing(ladders: Sequence[Ladder]) -> Climbing:
    """Decide as `climb` says: a generator of questions, which is sent answers."""
    bottom = here = tuple(ladder.levels[0] for ladder in ladders)
    asked: dict[tuple[Level, ...], float] = {}

    def ask(*models: tuple[Level, ...]) -> Generator[Question, Answer, None]:
        new = tuple(levels for levels in models if levels not in asked)
        if new:
            asked.update(zip(new, (yield Question(new, False)), strict=True))

    yield from ask(here)
    evidence = asked[here]
    lowest = before = np.asarray((yield Question((here,), True)))
    steps: list[ClimbStep] = []
    reached = [(here, evidence, before, 0)]  # and after how many steps
    barred: set[tuple[str, ...]] = set()
    margin = np.inf
    while True:
        reachable = {
            (k, level.name): (*here[:k], level, *here[k + 1 :])
            for k, ladder in enumerate(ladders)
            for level in ladder.levels
            if level is not here[k] and level.after in ("", here[k].name)
        }
        open_to = {key: levels for key, levels in reachable.items() if _names(levels) not in barred}
        yield from ask(*open_to.values())
        tried = {key: asked[levels] for key, levels in open_to.items()}
        top = max([evidence, *tried.values()])
        least = max(top - ASKED, evidence + ASKED)
        margin = min([margin, *(abs(each - least) for each in tried.values())])
        alike = [key for key in tried if tried[key] > least]
        if not alike:
            break
        best = max(alike, key=lambda key: (foreseen(open_to[key]), tried[key]))
        rivals = [tried[best] - tried[key] for key in alike if key != best]
        margin = min([margin, *(abs(lead) for lead in rivals)])
        levels, found = open_to[best], tried[best]
        after = np.asarray((yield Question((levels,), True)))
        worse = after - before
        error = worse.std() / np.sqrt(len(worse))
        # never true of nothing left out
        taken = bool(worse.mean() < error)
        if not np.isnan(error):
            margin = min(margin, abs(worse.mean() - error) / max(error, 1e-300))
        steps.append(
            ClimbStep(
                ladders[best[0]].name, best[1], found - evidence,
                float(before.mean()), float(after.mean()), taken,
            )
        )  # fmt: skip
        if taken:
            here, evidence, before = levels, found, after
            reached.append((here, evidence, before, len(steps)))
        else:
            barred.add(_names(levels))
    if len(reached) > 1 and len(lowest):
        more = before - lowest
        error = more.std() / np.sqrt(len(more))
        allowed = TOGETHER * error
        margin = min(margin, abs(more.mean() - allowed) / max(error, 1e-300))
        if more.mean() > allowed:  # each step was worse by less than chance, and all add up
            here, evidence, before, kept = min(reached, key=lambda one: float(one[2].mean()))
            steps[kept:] = [replace(step, taken=False) for step in steps[kept:]]
    lowest_evidence = asked[bottom]
    alone = {
        level: asked[*bottom[:k], level, *bottom[k + 1 :]] - lowest_evidence
        for k, ladder in enumerate(ladders)
        for level in ladder.levels
        if level is not bottom[k] and level.after in ("", bottom[k].name)
    }
    gain = evidence - lowest_evidence
    return Course(here, tuple(steps), alone, gain, lowest, before, float(margin))


def run(course: Climbing, answer: Callable[[Question], Answer]) -> Course:
    """Run a climb to its end with a function that answers its questions."""
    question = next(course)
    while True:
        try:
            question = course.send(answer(question))
        except StopIteration as end:
            found: Course = end.value
            return found


def climb_of(
    course: Course,
    ladders: Sequence[Ladder],
    gain: Callable[[Level], float],
    noise_factor: float,
    near: RobotModel,
    richest: Callable[[], RobotModel],
) -> Climb:
    """Climb from its course; `gain` gives the evidence of levels that no question asked for."""
    alone = dict(course.alone)

    def of(level: Level) -> float:
        if level not in alone:
            alone[level] = gain(level)
        return alone[level]

    def offers() -> tuple[Offer, ...]:
        each = zip(ladders, course.levels, strict=True)
        return tuple(chain.from_iterable(_offers(*one, course, of) for one in each))

    best = max(course.alone.items(), key=lambda each: each[1], default=None)
    return Climb(
        course.levels, course.steps, offers, best and (best[0].name, best[1]), course.gain,
        noise_factor, len(course.lowest), float(course.lowest.mean()),
        float(course.before.mean()), near, richest,
    )  # fmt: skip


def _offers(
    ladder: Ladder, reached: Level, course: Course, gain: Callable[[Level], float]
) -> Iterator[Offer]:
    """Outcome of each level of a ladder."""
    tried = {step.level: step.taken for step in course.steps if step.ladder == ladder.name}
    confirmed = not np.isnan(course.lowest).any()
    for level in ladder.levels[1:]:
        gained = gain(level)
        outcome = "asked for" if gained > ASKED else "not asked for"
        if level is reached:
            outcome = "taken"
        elif level.name in tried:
            refused = "refused by the poses left out" if confirmed else "too few poses to confirm"
            outcome = "replaced" if tried[level.name] else refused
        elif reached.names and gained > ASKED:
            outcome = f"not needed beside {reached.name}"
        yield Offer(ladder.name, level.name, gained, outcome)
    for reason in ladder.why_not:
        what, why = reason.split(": ", maxsplit=1)
        yield Offer(ladder.name, what, float("nan"), f"not offered: {why}")


def _names(levels: Sequence[Level]) -> tuple[str, ...]:
    return tuple(level.name for level in levels)
