"""Rows that do not fit the others: bad shots, and poses that the model misses."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, Bool, Index, frozen
from calib.geometry.chain import Chain
from calib.geometry.model import RobotModel
from calib.identification.folds import parts_of, some_poses
from calib.identification.identify import Identification, identify
from calib.identification.levels import Ladder
from calib.identification.link_widths import USUAL, LinkWidths, link_widths
from calib.identification.outliers.bad_shots import CHANCE, BadShots, bad_shots, doubtful
from calib.identification.outliers.search import search_outliers
from calib.identification.row_ladders import RowTerms, row_ladders
from calib.measurement.observations import Measurements
from calib.measurement.prediction import missed, predict, tool_poses
from testbed.identify.fit import Fitted, bends_of, plain_fit
from testbed.identify.frames import StartFrames, wide_prior
from testbed.identify.records import FittedModel
from testbed.robots.robot import Robot
from testbed.streams import stream
from testbed.units import DEG, counted, listed, millimetres, significant

ELSEWHERE = 3.0
"""A row fits another pose if it misses that one by less than so many typical misses."""
FAR_OFF = 3.0
"""Rows missed by more than so many medians are said to be."""
AS_STATED = 1.2
"""Noise in units of the stated one up to which robust residuals are as large as stated: that of a
few dozen good poses scatters by a tenth."""
MOST_NAMED = 10
"""Rows that a model misses, named in one sentence."""


@dataclass(frozen=True, slots=True, eq=False)
class LookedAt:
    """What a look at the training rows found."""

    noise_factor: float
    """Typical residual of the model looked at, in units of the stated noise."""
    asked: BadShots | None = None
    """What richer models say of them; None where nothing was suspected."""
    suspects: Index = ()  # type: ignore[assignment]  # becomes an array in __post_init__
    """Training rows that the model looked at misses."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "suspects", frozen(self.suspects, np.int64))

    @property
    def bad(self) -> Index:
        """Training rows to leave out, worst first."""
        return frozen((), np.int64) if self.asked is None else self.asked.bad


@dataclass(frozen=True, slots=True, eq=False)
class Looking:
    """Training rows to be looked at, and the models that are asked."""

    frames: StartFrames
    """Where fits begin, and what is free."""
    train: Measurements
    robot: Robot
    """As its maker describes it."""
    known: RowTerms
    """What the session says of its rows."""
    seed: int
    """Of the poses that confirm a model."""

    @property
    def mounted(self) -> Chain:
        """The arm as it stands, see `extended_model`."""
        return self.robot.model.chain

    @property
    def bends(self) -> tuple[Ladder, ...]:
        """Ladders of what bends the arm, whatever the rows say."""
        payload = self.train.conditions.usual_payload
        stated = None if payload is None else tuple(payload.tolist())
        return bends_of(self.frames.start, self.robot, stated)

    def asked(self, near: RobotModel) -> BadShots:
        """What richer models say of the rows, about a fit of geometry."""
        start, parameters = self.frames.start, self.frames.parameters
        ladders = (*self.bends, *row_ladders(start, self.train, self.known))
        return bad_shots(
            start, near, self.train, parameters, prior=wide_prior(parameters, start),
            ladders=ladders, rng=stream(self.seed, "confirm"),
        )  # fmt: skip

    def widths(self, train: Measurements, links: Collection[str]) -> LinkWidths:
        """How much wider than usual the prior of some links has to be, by the rows in use."""
        start, parameters = self.frames.start, self.frames.parameters
        prior, rng = wide_prior(parameters, start), stream(self.seed, "confirm")
        asked = some_poses(train, rng)
        part = parts_of(asked, rng)
        if part is None:
            return USUAL
        near = identify(start, asked, parameters, prior=prior).model
        ladders = (*self.bends, *row_ladders(start, asked, self.known))
        return link_widths(
            start, near, asked, parameters, ladders, part, prior=prior, links=links
        )  # fmt: skip


def first_look(looking: Looking, plain: Identification) -> LookedAt:
    """Look for training rows that geometry misses; richer models say whether these are bad.

    Parameters
    ----------
    looking : Looking
        The rows.
    plain : Identification
        Least squares of geometry over all of them.
    """
    frames = looking.frames
    search = search_outliers(
        frames.start, plain, looking.train, frames.parameters, chance=CHANCE, noise_is_known=False
    )
    if not len(search.suspects):
        return LookedAt(search.noise_factor)
    shots = looking.asked(search.identification.model)
    return LookedAt(search.noise_factor, shots, search.suspects)


def second_look(looking: Looking, chosen: Fitted, before: LookedAt) -> LookedAt:
    """The same by the model that was chosen, where geometry is so rough that it suspects nothing.

    Nothing more is asked where a richer model was asked before.
    """
    name, start, fit = chosen
    if before.asked is not None or name == "geometric" or fit.loss != "squared":
        return before
    suspects = np.flatnonzero(doubtful(start, fit, looking.train))
    if not len(suspects):
        return before
    frames = looking.frames
    near = plain_fit(frames.start, looking.train, frames.parameters, "cauchy").model
    return replace(before, asked=looking.asked(near), suspects=suspects)


def bad_words(
    found: LookedAt, train: Measurements, name: list[str], *, used: bool
) -> tuple[str, ...]:
    """A sentence on each bad shot among the training rows, worst first; `name` calls each row."""
    shots = found.asked
    if shots is None:
        return ()
    there, part = None, "" if used else " and took no part"
    if not train.tool.any() and not shots.judge.model.joint_errors.follow(train.conditions):
        there = tool_poses(shots.judge.model, train)  # whichever row stands at these joints
    return tuple(
        f"{name[row]} does not fit the others{part}: the richest model offered, fitted without it, "
        f"misses it by {_error(shots, train, row)}, where {_typical(shots, train, row)} is typical"
        f"{_elsewhere(shots, train, row, name, there)}"
        for row in map(int, shots.bad)
    )


def model_words(
    found: LookedAt, train: Measurements, chosen: FittedModel, name: list[str]
) -> tuple[str, ...]:
    """What is missed and not called bad: sentences on the model, and on shots that may be bad.

    Parameters
    ----------
    found : LookedAt
        Bad shots among the training rows.
    train : Measurements
        The training rows.
    chosen : FittedModel
        The model handed out.
    name : list of str
        (m,) how each row is called.
    """
    shots = found.asked
    if shots is None:
        return ()
    if shots.too_many:
        poses = train.together
        missed = len(np.unique(poses[shots.sound]))
        return (
            f"{missed} of {counted(len(np.unique(poses)), 'training pose')} do not fit "
            f"({_named(shots.sound, shots.misses, name)}): too many for gross errors, so none is "
            f"left out; {_others(found)}",
        )
    misses = predict(chosen.identification.model, train).misses
    rows, bad = set(shots.sound.tolist()), set(shots.bad.tolist())
    rows |= {k for k in found.suspects if misses[k] > FAR_OFF * _median(misses, train, k)}
    rows -= bad
    if not rows:
        return ()
    explained = {k for k in rows if shots.misses[k] < FAR_OFF * _median(shots.misses, train, k)}
    texts = []
    if explained:
        far, them, names = _missed(explained, misses, train, name)
        there = "this one is" if them == "it" else "these are"
        texts.append(
            f"the model fails in a region: it misses {names} by up to {far}, and a richer model, "
            f"fitted without {them}, explains {them}; nothing is left out, as only another reading "
            f"there could show whether {there} bad"
        )
    if doubted := rows - explained:
        far, them, names = _missed(doubted, misses, train, name)
        most = millimetres(shots.misses[list(doubted)].max())
        texts.append(
            f"the model misses {names} by up to {far}, and a richer model, fitted without {them}, "
            f"by up to {most} mm: probably {'a bad shot' if them == 'it' else 'bad shots'}, not "
            "left out, as that model may be as far off at poses that so few are like; measure "
            f"{them} again"
        )
    if alone := [row for row in rows if _another_fits(row, rows | bad, misses, train)]:
        beside = _named(alone, misses, name)
        texts[-1] += f"; for {beside}, another reading of the same pose fits: check there first"
    return tuple(texts)


def _others(found: LookedAt) -> str:
    """What is wrong where too many poses do not fit: a poor model misses the others as well."""
    if found.noise_factor > AS_STATED:
        return "the model or the stated noise is wrong"
    return (
        "but all others are as near as the stated noise: look for bad shots, and for something "
        "that moved; with --loss cauchy these poses hardly count"
    )


def _missed(
    rows: set[int], misses: Array, train: Measurements, name: list[str]
) -> tuple[str, str, str]:
    """By how much rows are missed and what is typical; "it" or "them"; their names."""
    worst = max(rows, key=lambda row: misses[row])
    typical = millimetres(_median(misses, train, worst), 2)
    far = f"{millimetres(misses[worst])} mm, where {typical} mm is typical"
    return far, "it" if len(rows) == 1 else "them", _named(rows, misses, name)


def _another_fits(row: int, missed: set[int], misses: Array, train: Measurements) -> bool:
    """Whether another reading of the pose is not missed: no model explains one of them alone."""
    others = np.setdiff1d(np.flatnonzero(train.together == train.together[row]), sorted(missed))
    return bool((misses[others] < FAR_OFF * _median(misses, train, row)).any())


def _named(rows: Iterable[int], misses: Array, name: list[str]) -> str:
    """The rows that are missed most, and how many more there are."""
    ranked = sorted(rows, key=lambda row: -misses[row])
    return listed([name[row] for row in ranked], MOST_NAMED)


def _median(misses: Array, train: Measurements, row: int) -> float:
    """Median miss of the rows of the kind of one row [m]: a distance shows one direction alone."""
    return float(np.median(misses[train.kind == train.kind[row]]))


def _error(shots: BadShots, train: Measurements, row: int) -> str:
    """By how much a row is missed, in words."""
    text = f"{millimetres(shots.misses[row])} mm"
    if not train.is_pose[row]:
        return text
    return f"{text} and {significant(shots.turns[row] * DEG, 2)} deg"


def _typical(shots: BadShots, train: Measurements, row: int) -> str:
    """The same of a typical row of its kind."""
    text = f"{millimetres(_median(shots.misses, train, row), 2)} mm"
    if not train.is_pose[row]:
        return text
    return f"{text} and {significant(_median(shots.turns, train, row) * DEG, 2)} deg"


def _alike(train: Measurements, row: int) -> Bool:
    """Rows (m,) of a place that a tip touches again, whose joints fit the reading of one anyway."""
    same = (train.position == train.position[row]).all(axis=1)
    return np.asarray(same & (train.station == train.station[row]) & ~train.is_pose[row])


def _elsewhere(
    shots: BadShots, train: Measurements, row: int, name: list[str], there: Array | None
) -> str:
    """Whose joints the reading of a row fits, if it does: then rows were swapped.

    `there` are the poses (m, 4, 4) at the joints of all rows, where these tell them.
    """
    others = np.flatnonzero((train.q != train.q[row]).any(axis=1) & ~_alike(train, row))
    if train.is_distance[row] or not len(others):
        return ""
    here = train.rows(np.full(len(others), row))
    here, T = replace(here, q=train.q[others]), None if there is None else there[others]
    misses, turns = missed(shots.judge.model, here, T)
    fits = misses < ELSEWHERE * _median(shots.misses, train, row)
    if train.is_pose[row]:
        fits &= turns < ELSEWHERE * _median(shots.turns, train, row)
    if not fits.any():
        return "; measure it again"
    best = int(others[np.argmin(np.where(fits, misses, np.inf))])
    return f"; it fits the joints of {name[best]}: were they swapped?"
