"""A measured UR10, public data: does a statement hold where it says so, and warn where it does not?

Studies at full size, run by hand: `pytest -m study tests/real/test_places.py`, ten minutes. Every
pose is judged by the R95 of its own region. Found, coverage in %:

* from ten parts of the workspace, twice each, 100 poses identified from, 100 held out: of all
  others of the part, drawn like those that guard, B 94.3 and C 95.8. Those inside it B 93.5 (92.2
  to 95.0 over six seeds), at the edge, where the radius grows, 96.7, outside (where nothing is
  stated) 98.7; C 95.8, 98.3, 98.4. Guarded by ellipsoids alone B had 92.5 inside;
* of poses elsewhere that miss by 1.5 ungrown radii 70 % are warned of in B: its others are where
  the upper arm is upright, and 1.2 % of the poses of the very same place miss by as much;
* C to B and D with base and tool refitted: all that miss by so much are warned of, nearly all poses
  of B and D lie outside;
* as sessions, one held out in frames of its own: C to B 97.3 inside, radius 2.4 mm; B to C 95.0,
  radius 1.0 mm; none misses by 1.5 radii.
"""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.model_choice import choose
from calib.identification.prior import weak_prior
from calib.identification.start.start import start_frames
from calib.measurement.prediction import predict
from calib.uncertainty.held_out import first_of_pose
from calib.uncertainty.judgement import judge
from calib.uncertainty.statement.distance import distance_radius
from calib.uncertainty.statement.stated_point import widened
from testbed.files.read import read_session
from testbed.identify.calibrate import Options, calibrate
from testbed.identify.frames import is_frame, wide_prior
from testbed.robots.catalog import load_robot
from testbed.streams import stream
from tests.testbed.identify.test_ur10 import CONFIG, SERIES, read

DATA = Path(__file__).parents[3] / "shared" / "data"
TRAIN, HELD_OUT, FRAMES = 100, 100, 20
SESSIONS = """
[[session]]
name = "one"
file = "one.csv"

[[session]]
name = "two"
file = "two.csv"
held_out = true
frame_poses = 20
"""
pytestmark = [
    pytest.mark.study,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"the measured arms are not here: {DATA}"),
]


@cache
def arm():
    return load_robot("universal_ur10").model


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """One row of every pose: of two at one pose, one must not judge what the other identified."""
    folder = tmp_path_factory.mktemp("places")
    return cache(lambda series: first_of_pose(read(series, folder)[1].measurements))


def fitted(train, seed):
    """The chosen model, as `identify` does it."""
    start = start_frames(arm(), train, free_tool=True, free_anchors=()).model
    parameters = parameters_of(start)
    links = [name for name in parameters.free_names if not is_frame(name)]
    return choose(
        start, train, parameters, prior=wide_prior(parameters, start),
        own_prior=weak_prior(parameters.freeing(links), start), mounted=arm().chain,
        rng=stream(seed, "confirm"),
    ).identification  # fmt: skip


def believed(train, held_out, seed):
    """What is believed after a fit and its proof."""
    fit = fitted(train, seed)
    return judge(fit, held_out, train=train).belief


def judged(belief, model, rows):
    """Place, whether it is held, and whether it misses by 1.5 radii without growth, of each row."""
    reach = belief.proven.applies(rows.q)
    grown, plain = (
        distance_radius(widened(belief.regions(rows.q, growth=growth)))
        for growth in (reach.growth, 1.0)
    )
    misses = predict(model, rows).misses
    return reach, misses <= grown, misses > 1.5 * plain


def parts(q):
    """Parts of the workspace and of the joints: masks."""
    p = arm().poses(q)[:, :3, 3]
    radius, z = np.hypot(p[:, 0], p[:, 1]), p[:, 2]
    for x in (q[:, 0], z, radius, q[:, 2]):
        yield x < np.median(x)
        yield x >= np.median(x)
    for x in (q[:, 4], q[:, 1]):
        yield x < np.median(x)


@pytest.mark.parametrize("series", ["B", "C"])
def test_a_statement_from_one_part_holds_inside_and_at_its_edge(series, table):
    rows = table(series)
    seen = {"inside": [], "edge": [], "outside": []}
    alike = []  # all the others of the part, drawn like those that guard
    for seed in (1, 2):
        for mask in parts(rows.q):
            order = np.random.default_rng(seed).permutation(np.flatnonzero(mask))
            train, test = rows.rows(order[:TRAIN]), rows.rows(order[TRAIN : TRAIN + HELD_OUT])
            belief = believed(train, test, seed)
            there = np.concatenate([order[TRAIN + HELD_OUT :], np.flatnonzero(~mask)])
            reach, held, _ = judged(belief, belief.model, rows.rows(there))
            alike += held[: len(order) - TRAIN - HELD_OUT].tolist()
            for place, cells in seen.items():
                cells += held[reach.place == place].tolist()
    shares = {
        place: round(100 * float(np.mean(cells)), 1)
        for place, cells in (seen | {"alike": alike}).items()
    }
    print(f"\nUR10 {series}: held, % {shares}")  # noqa: T201  # figures of a study
    assert np.mean(alike) >= 0.94
    assert np.mean(seen["inside"]) >= 0.92
    assert np.mean(seen["edge"]) >= 0.92


def carried(model, rows):
    """The links of a model with base and tool refitted to some rows."""
    start = start_frames(model, rows, free_tool=True, free_anchors=()).model
    frames = [name for name in parameters_of(start).names if name.startswith(("base.", "tool."))]
    return identify(start, rows, parameters_of(start).freeing(frames)).model


@pytest.mark.parametrize("there", ["B", "D"])
def test_poses_of_another_series_that_are_missed_are_warned_of(there, table):
    """Proven on C alone; base and tool are refitted where the arm is used."""
    one, other = table("C"), table(there)
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        order, draw = rng.permutation(len(one)), rng.permutation(len(other))
        held_out = one.rows(order[TRAIN : TRAIN + HELD_OUT])
        belief = believed(one.rows(order[:TRAIN]), held_out, seed)
        model = carried(belief.model, other.rows(draw[:FRAMES]))
        reach, _, far = judged(belief, model, other.rows(draw[FRAMES:]))
        warned, beyond = (reach.place[far] != "inside").sum(), (reach.place == "outside").mean()
        print(f"\nUR10 C -> {there}: {warned} of {far.sum()} warned of, {beyond:.3f} outside")  # noqa: T201  # figures of a study
        assert warned >= 0.9 * far.sum()
        assert beyond > 0.9


@pytest.mark.parametrize(("one", "two"), ["CB", "BC"])
def test_a_session_in_frames_of_its_own_is_held_by_its_radius(one, two, tmp_path):
    """The product's own way: training in one session, the other one held out, 20 poses frames."""
    rng = np.random.default_rng(1)
    for name, series, count in (("one", one, TRAIN), ("two", two, 400 + FRAMES)):
        file = DATA / "ipa_ur10" / f"Series_{series}" / SERIES[series][0]
        head, *lines = file.read_text(encoding="utf-8").splitlines()
        some = [lines[k] for k in rng.permutation(len(lines))[:count]]
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *some]) + "\n")
    (tmp_path / "session.toml").write_text(CONFIG.format(series="two") + SESSIONS)
    robot = load_robot("universal_ur10")
    found = calibrate(robot, read_session(tmp_path, robot), Options(seed=1))
    rows = found.measurements.rows(found.split.is_test)
    belief, misses = found.proof.belief, found.fit.misses.position[found.split.is_test]
    held = misses <= distance_radius(widened(belief.seen_regions(rows)))
    reach = belief.proven.applies(rows.q)
    inside, radius = held[reach.place == "inside"].mean(), found.proof.point.radius_mean
    print(f"\nUR10 {one} to {two}: {inside:.3f} held inside, radius {1e3 * radius:.2f} mm")  # noqa: T201  # figures of a study
    assert inside >= 0.94
    assert (misses <= radius).mean() >= 0.95
