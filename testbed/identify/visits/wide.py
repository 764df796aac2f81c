"""Whose base and tool make a radius wide: frames of a session that its poses hardly show."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from calib.arrays import Bool, Index, frozen
from calib.measurement.observations import Measurements
from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.stated_point import common_radius
from testbed.files.visits.visit import OWN
from testbed.identify.calibration import Calibration
from testbed.identify.visits.report import of
from testbed.lengths import with_unit
from testbed.units import DEG, MM, counted, listed

TIMES = 2.0
"""So many times as wide as with known frames must a radius be, to say so: of 130 campaigns of two
sessions with 20 to 59 poses each it never was; the largest of 50 of them was 1.5."""
ALONE = 1.25
"""A part alone is the cause if knowing it leaves at most so many times what knowing both does."""
NARROWER = 0.5
"""A joint is named that moves by less than this part of its range at the poses judged."""


@dataclass(frozen=True, slots=True)
class WideFrames:
    """A session whose frames make the radius wide that is stated in them."""

    visit: int
    parts: tuple[str, ...]
    """base, tool: what would have to be known."""
    one_of_them: bool
    """Whether it is enough to know one of these."""
    radius: float
    """R95 at the poses judged, in the frames of the session [m]."""
    known: float
    """The same if the parts were known exactly [m]."""
    own: float
    """R95 at the poses that its frames were fitted to [m]."""
    other: tuple[str, float] | None
    """A session whose frames leave half of it at most at the same poses, and R95 in them [m]."""


@lru_cache(maxsize=1)  # verdict, reasons and next step ask the same
def wide_frames(calibration: Calibration) -> tuple[WideFrames, ...]:
    """Sessions whose frames make the radius wide, the one that is handed out first.

    Of that one at the poses of the stated radius, of others at those of their own that judge.
    """
    belief, table = calibration.proof.belief, calibration.measurements
    if belief is None or calibration.elsewhere or table.is_distance.any():
        return ()
    found = []
    for k, visit in enumerate(calibration.visits):
        own = of(calibration, k)
        fitted, judged = _fitted_and_judged(calibration, k)
        if not judged.any() or not fitted.any():
            continue
        where, frames = _first_rows(table, judged), _frames(calibration, own)
        radius = _radius(calibration, belief, where, own)
        known = _radius(calibration, _knowing(belief, sorted({*frames["base"], *frames["tool"]})),
                        where, own)  # fmt: skip
        if radius < TIMES * known:
            continue
        alone = tuple(
            part for part, numbers in frames.items()
            if _radius(calibration, _knowing(belief, numbers), where, own) < ALONE * known
        )  # fmt: skip
        others = [
            (other.name, _radius(calibration, belief, where, of(calibration, j)))
            for j, other in enumerate(calibration.visits)
            if not visit.held_out and not other.held_out and not k and j
        ]
        best = min(others, key=lambda one: one[1], default=None)
        found.append(
            WideFrames(
                k, alone or tuple(frames), len(alone) > 1, radius, known,
                _radius(calibration, belief, _first_rows(table, fitted), own),
                best if best is not None and TIMES * best[1] <= radius else None,
            )
        )  # fmt: skip
    return tuple(found)


def wide_words(calibration: Calibration) -> tuple[str, ...]:
    """Which sessions these are, and, where it is no next step, what would narrow the radius."""
    said = []
    for one in wide_frames(calibration):
        name = calibration.visits[one.visit].name
        poses = "its held-out poses" if one.visit else "the poses judged"
        text = (
            f'The poses of session "{name}" hardly show its {" and ".join(one.parts)}: in its '
            f"frames, R95 is {with_unit(one.radius)} at {poses}, which would be "
            f"{with_unit(one.known, one.radius)} if {_which(one)} known; at the poses that its "
            f"frames were fitted to it is {with_unit(one.own, one.radius)}"
        )
        if one.other is not None:
            name, radius = one.other
            there = with_unit(radius, one.radius)
            text += f'; in the frames of session "{name}", {there} at {poses}'
        said.append(f"{text}; {_mend(calibration, one)}" if one.visit else text)
    return tuple(said)


def wide_because(calibration: Calibration) -> str:
    """That frames of the session handed out make the stated radius wide; else empty."""
    one = _of_the_first(calibration)
    if one is None:
        return ""
    return (
        f"It is so wide because of the {' and '.join(one.parts)} of session "
        f'"{calibration.visits[0].name}", which its poses hardly show: if {_which(one)} known, '
        f"R95 would be {with_unit(one.known, one.radius)}."
    )


def wide_step(calibration: Calibration) -> str:
    """What to do about it before the radius is quoted; empty where there is nothing."""
    one = _of_the_first(calibration)
    return "" if one is None else f"First {_mend(calibration, one)}. Until then, "


def _of_the_first(calibration: Calibration) -> WideFrames | None:
    """What makes the stated radius wide, if frames do."""
    return next((one for one in wide_frames(calibration) if not one.visit), None)


def _which(one: WideFrames) -> str:
    """What would be known, as a subject."""
    if one.one_of_them:
        return "one of them were"
    return "it were" if len(one.parts) == 1 else "they were"


def _mend(calibration: Calibration, one: WideFrames) -> str:
    """What to measure or to state."""
    table, visit = calibration.measurements, calibration.visits[one.visit]
    fitted, judged = _fitted_and_judged(calibration, one.visit)
    told = f"its frames were fitted to {counted(table.rows(fitted).n_poses, 'pose')}"
    there, wanted = (np.ptp(table.q[rows], axis=0) for rows in (fitted, judged))
    if len(still := np.flatnonzero(there < NARROWER * wanted)):
        slides = calibration.nominal.chain.prismatic > 0
        moved = [
            f"joint {j + 1} by {there[j] * MM if slides[j] else there[j] * DEG:.0f} "
            f"{'mm' if slides[j] else 'deg'}"
            for j in still
        ]
        told += f", which move {listed(moved)} only"
    ways = [f'measure more poses in session "{visit.name}" ({told})']
    shared = {(part, getattr(other, part)) for other in calibration.visits for part in one.parts}
    free = [part for part in one.parts
            if getattr(visit, part) == OWN and (part, visit.name) not in shared]  # fmt: skip
    if free:
        which = " or ".join(free)
        ways.append(f'write {which} = "same as" another session, if it was the same there')
    if one.other is not None:
        ways.append(f'name session "{one.other[0]}" first, whose base and tool are then handed out')
    return "; or ".join(ways)


def _fitted_and_judged(calibration: Calibration, k: int) -> tuple[Bool, Bool]:
    """Rows (m,) that the frames of a session are fitted to, and rows at whose poses it is asked."""
    own, judges = of(calibration, k), calibration.split.is_test
    fitted = own & ~judges if calibration.visits[k].held_out else own & calibration.is_used
    return fitted, own & judges if k else calibration.is_stated


def _radius(calibration: Calibration, belief: Belief, where: Index, own: Bool) -> float:
    """R95 at the joints of some rows, in the frames of the session with rows `own` (m,) [m].

    Where it saw several targets, of the least known of them. The stated radius grows where held-out
    errors ask for it; so does this one.
    """
    point, whole = calibration.proof.point, calibration.proof.belief
    assert point is not None  # as there is a belief
    assert whole is not None
    usual = common_radius(whole.regions(calibration.stated_q, target=calibration.target))
    some, asked = calibration.measurements.rows(own), calibration.measurements.rows(where)
    seen = some.rows(some.station == some.station[0])
    columns = np.column_stack([seen.tool, seen.reflector, seen.offset])
    radii = []
    for row in np.unique(columns, axis=0, return_index=True)[1]:
        alike = {name: getattr(seen, name)[np.full(len(where), row)]
                 for name in ("station", "tool", "reflector", "offset", "kind")}  # fmt: skip
        radii.append(common_radius(belief.seen_regions(replace(asked, **alike))))
    return max(radii) * point.radius_mean / usual


def _first_rows(table: Measurements, rows: Bool) -> Index:
    """The first row of each pose among some rows (m,)."""
    places = np.flatnonzero(rows)
    first: Index = places[np.unique(table.pose_id[places], return_index=True)[1]]
    return first


def _frames(calibration: Calibration, own: Bool) -> dict[str, list[int]]:
    """Numbers of base and of tool of a session, by their places among all numbers."""
    rows = calibration.measurements.rows(own)
    base = {f"station{k + 1}" if k else "base" for k in np.unique(rows.station).tolist()}
    tool = {f"tool{k + 1}" if k else "tool" for k in np.unique(rows.tool).tolist()}
    tool |= {f"reflector{k + 1}" for k in np.unique(rows.reflector).tolist() if k >= 0}
    names = calibration.fit.identification.parameters.names
    return {"base": _places(names, base), "tool": _places(names, tool)}


def _places(names: Collection[str], frames: set[str]) -> list[int]:
    """Places of the numbers of some frames."""
    return [k for k, name in enumerate(names) if name.split(".")[0] in frames]


def _knowing(belief: Belief, numbers: list[int]) -> Belief:
    """The belief if some numbers were known exactly, with all that this tells of the others.

    References
    ----------
    Of jointly normal numbers x and f with covariance C, x given f: x - C_xf pinv(C_ff) f. The same
    map is applied to what the noise and what a misfit leave in them.
    """
    C = belief.covariance + belief.misfit.upper**2 * belief.misfit_covariance
    free = [k for k in numbers if C[k, k] > 0]  # the others are held
    scale = np.sqrt(np.diag(C)[free])
    inner = np.linalg.pinv(C[np.ix_(free, free)] / np.outer(scale, scale), hermitian=True)
    M = np.eye(len(C))
    M[:, free] -= (C[:, free] / scale) @ inner / scale
    left = [frozen(M @ S @ M.T) for S in (belief.covariance, belief.misfit_covariance)]
    return replace(belief, covariance=left[0], misfit_covariance=left[1])
