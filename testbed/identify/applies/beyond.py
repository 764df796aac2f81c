"""Where a misfit may come from: poses where the training says little.

And a model taken that held-out poses do not bear out.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.geometry.model import RobotModel
from calib.uncertainty.statement.departure import named
from testbed.identify.calibration import Calibration
from testbed.identify.errors import of_poses
from testbed.identify.session import TARGET
from testbed.lengths import with_unit
from testbed.units import DEG, MM, fixed, listed, significant

FARTHER = 2.0
"""So many times as far must held-out poses be missed: with ten of them or more, no chance does it
where both kinds come from one place."""
FEWEST = 10
WIDER = 1.2
"""So many times as wide must the radius be by shots far off, to say so."""
MOST_NAMED = 5
"""Of these shots, named in what is to be done."""
CHANCE = 2.0
"""Standard errors by which chance makes one of two alike models worse, one time in forty."""
AHEAD, AHEAD_SLIDE = np.radians(5.0), 0.02
"""A joint is named that goes further beyond its training range [rad, m]."""


def beyond_words(calibration: Calibration) -> tuple[str, ...]:
    """Whether held-out poses are missed much further than training poses left out in turn, and why.

    Both were no part of a fit when it was judged by them: where they differ, the place does, unless
    a few shots far off make the mean.
    """
    test, turn = calibration.fit.test, calibration.choice.confirmation
    split, far = calibration.split, far_words(calibration)
    if test is None or not len(turn) or calibration.elsewhere or split.is_test.sum() < FEWEST:
        return far
    left_out = float(turn[int(calibration.choice.chosen == "extended")])
    few = bool(calibration.gross.held_out_sentences)
    if min(test.position.mean, test.median if few else np.inf) < FARTHER * left_out:
        return far
    text = (
        f"The error at held-out poses is {significant(test.position.mean / left_out, 2)} times "
        f"that at training poses left out in turn ({fixed(test.position.mean * MM, 3)} against "
        f"{fixed(left_out * MM, 3)} mm): "
    )
    there, mend = "they lie where training poses say little", "add training poses there"
    if joints := _ahead(calibration):
        return (
            *far,
            f"{text}{there} ({joints} beyond the training poses); {mend}, and the radius shrinks",
        )
    return (
        *far,
        f"{text}no joint goes beyond its training poses; either {there} ({mend}), or the robot "
        "had changed by then: it was bumped, carried another load, or is not the same robot",
    )


def drawn_out(calibration: Calibration) -> float | None:
    """R95 without held-out shots that are far off [m]; None where it would be hardly smaller."""
    less, point = calibration.gross.radius_without, calibration.proof.point
    if less is None or point is None or calibration.elsewhere:
        return None
    return None if point.radius_mean < WIDER * less else less


def far_words(calibration: Calibration) -> tuple[str, ...]:
    """That held-out shots far off make the radius wide, where it would be narrower without them."""
    less, far = drawn_out(calibration), calibration.gross.held_out_sentences
    if less is None:
        return ()
    more = f" (and {len(far) - 1} more like it)" if len(far) > 1 else ""
    return (
        "Readings that are far off enlarge the radius, which would be "
        f"{with_unit(less)} without them: {far[0]}{more}; if a reading "
        "proves to be bad, measure the pose again, or remove the row and state that you did",
    )


def far_step(calibration: Calibration) -> str:
    """What to do about such shots before anything is quoted; empty where there is nothing."""
    less, names = drawn_out(calibration), calibration.gross.held_out_names
    if less is None:
        return ""
    poses = _of_one_pose(names)
    shown = poses[:MOST_NAMED]
    if len(poses) > MOST_NAMED:
        shown.append(f"{len(poses) - MOST_NAMED} more (see Outliers)")
    them, are = ("it", "stands") if len(names) == 1 else ("them", "stand")
    return (
        f"First look into held-out {listed(shown)}, which {are} out: without {them}, R95 would be "
        f"{with_unit(less)}. If the reading is wrong, measure the pose again, or remove "
        "the row and state that you did; if it is right, the model fails there. Until then, "
    )


def _of_one_pose(names: Sequence[str]) -> list[str]:
    """Names of rows as one for each pose, with its targets behind it where there are several."""
    poses = dict[str, list[str]]()
    for name in names:
        poses.setdefault(name.partition(TARGET)[0], []).append(name)
    return [
        rows[0]
        if len(rows) == 1
        else f"{pose} ({listed([row.removeprefix(pose + TARGET) for row in rows])})"
        for pose, rows in poses.items()
    ]


def simpler_words(calibration: Calibration) -> tuple[str, ...]:
    """That geometry alone misses held-out poses by less than the model taken, where it does.

    It is said and changes nothing: poses that chose a model would be no test of it.
    """
    choice, is_test = calibration.choice, calibration.split.is_test
    fits = {fit.model: fit for fit in calibration.fits}
    if choice.chosen != "extended" or "geometric" not in fits or calibration.elsewhere:
        return ()
    if fits["geometric"].test is None:
        return ()
    simpler, taken = (
        of_poses(fits[name].misses.position, calibration.measurements, is_test)
        for name in ("geometric", "extended")
    )
    more = taken - simpler
    if more.mean() <= 0:
        return ()
    count = len(more)
    text = (
        f"At the {count} held-out poses, geometry alone has smaller errors than the chosen model: "
        f"{fixed(simpler.mean() * MM, 4)} against {fixed(taken.mean() * MM, 4)} mm on average"
    )
    if count > 1 and (error := float(more.std(ddof=1)) / np.sqrt(count)) > 0:
        size = float(more.mean()) / error
        few = "this may be chance" if size < CHANCE else "more than chance makes likely"
        text += f", {fixed(size, 1)} standard errors of the difference, pose by pose: {few}"
    return (f"{text}; --model geometric uses geometry alone",)


def map_words(model: RobotModel, measured: Array, q: Array) -> tuple[str, ...]:
    """Targets q (m, n) that turn a joint beyond its waves' measurements by half a wave [rad].

    Waves that come again each turn are known a turn further on as well. `measured` (k, n) are the
    joints that the model was identified from [rad].
    """
    said = []
    for i in range(q.shape[1]):
        orders = [t.order for t in model.joint_errors.terms if t.is_wave and t.joint == i]
        if not orders or model.chain.kinds[i] == "prismatic":
            continue
        half, (low, high) = np.pi / max(orders), (measured[:, i].min(), measured[:, i].max())
        again = all(float(order).is_integer() for order in orders)
        turns = 2 * np.pi * np.arange(-2, 3) if again else np.zeros(1)
        there = q[:, i, None] + turns
        away = np.maximum(low - there, there - high).min(axis=1)
        if len(far := np.flatnonzero(away > half)):
            ends = " to ".join(fixed(end * DEG, 0) for end in (low, high))
            said.append(
                f"{named('target', far)} {'turns' if len(far) == 1 else 'turn'} joint {i + 1} up "
                f"to {fixed(float(away.max()) * DEG, 0)} deg beyond what was measured ({ends} "
                f"deg), more than half a wave of its joint errors ({fixed(half * DEG, 1)} deg): "
                "no measurement shows these errors there; add training poses there"
            )
    return tuple(said)


def _ahead(calibration: Calibration) -> str:
    """Joints that held-out poses take further than training poses do, and how far."""
    q, split = calibration.measurements.q, calibration.split
    train, test = q[split.is_train], q[split.is_test]
    further = np.maximum(train.min(axis=0) - test.min(axis=0), test.max(axis=0) - train.max(axis=0))
    slides = calibration.fit.identification.model.chain.prismatic > 0
    return ", ".join(
        f"joint {i + 1} goes {fixed(far * (MM if slide else DEG), 0)} {'mm' if slide else 'deg'}"
        for i, (far, slide) in enumerate(zip(further, slides, strict=True))
        if far > (AHEAD_SLIDE if slide else AHEAD)
    )
