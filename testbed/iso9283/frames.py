"""The frame of the readings against that of the commands: as stated, or brought there by a fit."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, frozen
from calib.geometry.frames import log_so3, transform, transform_points
from testbed.files.nests.motions import best_fit
from testbed.files.refusal import refusal
from testbed.iso9283.records import CycleTest, PathRuns, Visits
from testbed.units import DEG, MM, millimetres, significant

FEWEST_POINTS = 4
"""Points that a fitted frame needs, three of them not on one line."""
FLAT = 1e-3
"""Second extent of the points over the first below which they lie on one line."""
TIMES, LEAST = 5.0, 1e-3
"""A frame is asked about where a fit leaves a fifth of the deviations, and they exceed this [m]."""
NOTHING = 1e-3
"""Share by which a fit lowers the deviations that nobody needs to know."""
SPREADS = (0.6, 1.6)
"""Measured over commanded extent, outside of which a unit is wrong."""
FAR, TELLS = 1e-2, 1e-6
"""Readings that spread so far, of commands that spread so little, are in another unit [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The rigid motion that brings readings nearest to the commands."""

    T: Array
    """(4, 4) T_command_reading [m]."""
    before: float
    """Root mean square deviation without it [m]."""
    after: float
    points: int
    flat: bool
    """Whether the points do not tell it: too few, or on one line."""

    @property
    def size(self) -> str:
        """Its shift and its turn in words."""
        turn = float(np.linalg.norm(log_so3(self.T[None, :3, :3])[0])) * DEG
        shift = float(np.linalg.norm(self.T[:3, 3])) * MM
        return f"{significant(shift)} mm and {significant(turn)} deg"


def in_command_frame(test: CycleTest) -> tuple[CycleTest, Array, str]:
    """The test with its readings in the frame of the commands, that motion, and a sentence on it.

    Raises
    ------
    InputError
        M21: another unit; M32: the readings stand in another frame and nobody said so; M27: too
        few points to fit one.
    """
    where = test.files[-1].path.name if test.files else test.name
    found = fit_of(test, where)
    after = millimetres(found.after)
    if test.fitted:
        if found.flat:
            message = f"{found.points} points on a line or fewer than {FEWEST_POINTS} fit no frame"
            fix = "measure more poses, or bring the readings into the robot's frame beforehand"
            raise refusal(where, "iso9283.frame", message, code="M27", fix=fix)
        told = (
            f"The readings were brought into the frame of the commands by a best fit over "
            f"{found.points} points ({found.size}), which leaves {after} mm (rms): AP, AT and "
            "their parts contain only what no rigid motion explains, and the fit uses "
            f"6 of the {3 * found.points} degrees of freedom"
        )
        return _moved(test, found.T), found.T, told
    if shift := _shift_of(test):
        rows = "one row" if abs(shift) == 1 else f"{abs(shift)} rows"
        raise refusal(
            where, "pose_id",
            f"the readings lie {millimetres(found.before)} mm (rms) from the commands, and "
            f"{millimetres(_before(test, shift))} mm from those {rows} further "
            f"{'down' if shift > 0 else 'up'}",
            code="M31", allowed="each reading must be in the row of its command",
            fix=f"move the readings {rows} {'down' if shift > 0 else 'up'}",
        )  # fmt: skip
    if test.fitted is None and not found.flat and found.before > max(LEAST, TIMES * found.after):
        raise refusal(
            where, "iso9283.frame",
            f"the readings lie {millimetres(found.before)} mm (rms) from the commands, but "
            f"only {after} mm after a rigid motion by {found.size}",
            code="M32", allowed="AP and AT compare readings and commands in one frame",
            fix='under [iso9283] in session.toml, write frame = "fitted" if the readings are in '
            'another frame, or frame = "robot" if this is the error of the robot',
        )  # fmt: skip
    said = "as the session states" if test.fitted is False else "as no other frame is stated"
    told = f"The readings are assumed to be in the frame of the commands, {said}"
    if not found.flat and found.after < found.before * (1 - NOTHING):
        before = millimetres(found.before)
        told += f"; a best fit would lower the rms deviation from {before} to {after} mm"
    return test, np.eye(4), told


def _shift_of(test: CycleTest) -> int:
    """Rows by which the readings stand away from their commands, in cycles of the same order; 0."""
    if test.visits is None or len(test.visits.command) < FEWEST_POINTS:
        return 0
    stated = _before(test, 0)
    best = min((1, -1, 2, -2), key=lambda shift: _before(test, shift))
    far = stated > max(LEAST, TIMES * _before(test, best))
    return best if far else 0


def _before(test: CycleTest, shift: int) -> float:
    """Rms deviation of the poses from the commands some poses further on [m]."""
    assert test.visits is not None
    seen, sent = test.visits.position.mean(axis=1), test.visits.command
    return float(np.sqrt(np.square(seen - np.roll(sent, -shift, axis=0)).sum(axis=1).mean()))


def fit_of(test: CycleTest, where: str) -> Fit:
    """The best fit of means over all cycles to their commands; M21 where the unit is wrong."""
    seen, sent, usual = [], [], []
    if test.visits is not None:
        seen.append(test.visits.position.mean(axis=1))
        sent.append(test.visits.command)
        usual.append(np.median(test.visits.position, axis=1))
    for path in test.paths:
        if path.matched:
            seen.append(np.mean(path.runs, axis=0))
            sent.append(path.command)
            usual.append(np.median(path.runs, axis=0))
    if not seen:
        return Fit(np.eye(4), 0.0, 0.0, 0, True)
    a, b = np.concatenate(seen), np.concatenate(sent)
    medians = np.concatenate(usual)  # one missed shot is no other unit
    extent, wanted = (np.linalg.svd(x - x.mean(axis=0), compute_uv=False) for x in (medians, b))
    # commands in another unit may all lie within a millimeter; at one place they have none
    told = wanted[0] > LEAST or (wanted[0] > TELLS and extent[0] > FAR)
    if len(a) > 1 and told and not SPREADS[0] < extent[0] / wanted[0] < SPREADS[1]:
        raise refusal(
            where, "x_mm",
            f"the readings spread {significant(extent[0] / wanted[0])} times as far as the "
            "commands",
            code="M21", allowed=f"{SPREADS[0]:g} to {SPREADS[1]:g} times is usual",
            fix="check the units of both",
        )  # fmt: skip
    R, t = best_fit(a, b)
    flat = len(a) < FEWEST_POINTS or wanted[1] < FLAT * wanted[0]
    before, after = (float(np.sqrt(np.square(x - b).sum(axis=1).mean())) for x in (a, a @ R.T + t))
    return Fit(transform(R[None], t[None])[0], before, after, len(a), bool(flat))


def _moved(test: CycleTest, T: Array) -> CycleTest:
    """The test with all readings moved by T."""
    visits = None if test.visits is None else _moved_visits(test.visits, T)
    return replace(test, visits=visits, paths=tuple(_moved_path(one, T) for one in test.paths))


def _moved_visits(visits: Visits, T: Array) -> Visits:
    """Poses moved by T."""
    R, t = T[:3, :3], T[:3, 3]
    return replace(
        visits,
        position=frozen(visits.position @ R.T + t),
        rotation=None if visits.rotation is None else frozen(R @ visits.rotation),
        noise=_turned(visits.noise, R),
        turn_noise=_turned(visits.turn_noise, R),
    )


def _moved_path(path: PathRuns, T: Array) -> PathRuns:
    """A path moved by T."""
    runs = tuple(frozen(transform_points(T, run)) for run in path.runs)
    return replace(path, runs=runs, noise=_turned(path.noise, T[:3, :3]))


def _turned(covariance: Array | None, R: Array) -> Array | None:
    """Covariances (..., 3, 3) in turned axes."""
    return None if covariance is None else frozen(R @ covariance @ R.T)
