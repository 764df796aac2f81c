"""A recording read back: its numbers are the record's, its scene is where the models say."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.geometry.bodies import bent_forward
from calib.geometry.chain import forward
from calib.geometry.frames import target_points
from calib.measurement.accuracy import position_errors
from calib.uncertainty.regions import coverage_factor
from testbed.laboratory.truth.robot import TrueRobot, unmodelled_terms
from testbed.laboratory.truth.setting import in_turn
from testbed.laboratory.truth.terms import UnmodelledTerms
from testbed.recording.cell import box_edges, draw_arm
from testbed.recording.parameters import middles, parameter_panel, place
from testbed.recording.story import timeline_of
from testbed.recording.style import nice_factor
from testbed.recording.timeline import glide, growing, visit
from testbed.recording.write import strict_mode
from testbed.robots.catalog import load_robot
from testbed.robots.placements import placements
from testbed.run.derive import chapters_of
from testbed.studies.trial.recording_cell import stated_regions
from testbed.studies.trial.recording_ghost import (
    bends_left,
    draw_ghost,
    ghost_chains,
    smallest_equal,
)
from testbed.studies.trial.recording_select import select_chapter
from tests import recorded, viewed
from tests.campaign import with_records
from tests.planes import unfitting
from tests.recorded import (
    bytes_of,
    column,
    properties,
    record,
    scalars,
    small_campaign,
    store,
    structure,
    told,
)
from tests.reported import SMALL, played
from tests.testbed.laboratory.outcomes import settings
from tests.toy_story import chapter

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "recording.txt"
SINGLE = 2e-6
"""Scene geometry is float32: 1e-7 of about 3 m, and a product of seven transforms."""


@pytest.fixture(scope="module")
def campaign():
    return small_campaign()


@pytest.fixture(scope="module")
def shown(campaign):
    return recorded.shown(campaign)


@pytest.fixture(scope="module")
def timeline(campaign):
    return recorded.timeline(campaign)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording") / "campaign.rrd")


@pytest.fixture(scope="module")
def opened(path):
    return store(path)


def test_curves_are_the_records_numbers_bit_for_bit(opened, shown):
    judged, trial = shown.estimate.comparison, shown.trial
    for entity, timeline, expected in (
        (f"/select/{trial.selection.criterion}", "exchange", trial.selection.way_figures),
        ("/evaluate/before", "test", judged.before * 1e3),
        ("/evaluate/after", "test", judged.after * 1e3),
    ):
        at, values = scalars(opened, entity, timeline)
        assert np.array_equal(at, np.arange(len(expected)))
        assert np.array_equal(values, expected)


@pytest.mark.parametrize(
    ("criterion", "rows", "figure", "said", "curve"),
    [
        ("O1", "whitened", 127922.4, "O1 127922", 127922.4),
        ("O2", "paper", 5.7841e-5, "O2 5.7841 × 10⁻⁵", 5.7841e-5),
        ("V", "whitened", 31.234567e-6, "V 31.235 µm", 31.234567),
        ("V", "paper", 0.25, "V 0.25000", 0.25),
    ],
)
def test_the_figure_of_a_set_has_its_unit_and_is_written_for_people(
    shown, criterion, rows, figure, said, curve
):
    selection = replace(
        shown.trial.selection, criterion=criterion, way=None, way_figures=None, value=figure
    )
    trial = replace(shown.trial, selection=selection, rows=rows)
    chapter = select_chapter(replace(shown, trial=trial), None)
    assert chapter.lines == [f"set 1 of 1, {said}"]
    (chart,) = chapter.charts
    assert ("[µm]" in chart.title) == ("µm" in said)
    assert chart.curves[0].values[0] == pytest.approx(curve, rel=1e-12)  # one multiplication


def test_exchange_after_exchange_ends_at_the_chosen_set_and_the_robot_shows_what_comes_in(
    opened, shown, timeline
):
    selection, phase = shown.trial.selection, timeline.phase("select")
    places = shown.setting.pool_nominal[:, :3, 3].astype(np.float32)
    at, rows = column(opened, "/world/chosen", "Points3D:positions")
    shown_sets = [np.array(row) for row in rows if row]
    assert np.array_equal(at[: len(shown_sets)], phase.at)
    assert len(shown_sets) == len(selection.way) > 3
    assert np.array_equal(shown_sets[-1], places[selection.indices])
    _, gone = column(opened, "/world/leaves", "Points3D:positions")
    for k in range(1, len(selection.way)):
        before, after = set(selection.way[k - 1].tolist()), set(selection.way[k].tolist())
        assert {tuple(p) for p in gone[k]} == {tuple(places[j].tolist()) for j in before - after}
        # at rest at a pose that is new in the set
        away = np.abs(shown.setting.pool_q[sorted(after - before)] - timeline.q[phase.at[k]])
        assert away.max(axis=1).min() < 1e-14
    assert phase.stop - phase.start <= 150


def test_every_text_fits_its_window(campaign):
    assert unfitting(told(campaign)) == []


def test_seen_errors_are_distances_between_measured_and_predicted_poses(opened, shown):
    seen = np.broadcast_to(np.eye(4), (len(shown.trial.measurements), 4, 4)).copy()
    seen[:, :3, 3] = shown.trial.measurements.position
    for name, model in (
        ("nominal", shown.setting.nominal),
        ("identified", shown.estimate.identification.model),
    ):
        expected = position_errors(seen, model.poses(shown.trial.measurements.q)) * 1e3
        _, values = scalars(opened, f"/measure/{name}", "pose")
        # a norm of differences of numbers near 1 m, in mm: 1e-13
        assert np.abs(values - expected).max() < 1e-12
    assert values.mean() == pytest.approx(
        shown.estimate.comparison.identification_after.mean * 1e3, rel=1e-12
    )


def test_properties_carry_the_truth_in_float64(opened, shown):
    found = properties(opened)
    setting, judged = shown.setting, shown.estimate.comparison
    assert np.array_equal(found["true_links"], setting.true.chain.links.ravel())
    assert np.array_equal(found["true_joint_errors"], setting.true.joint_errors.coefficients)
    assert np.array_equal(found["true_step"], judged.true_step)
    assert np.array_equal(found["step"], shown.estimate.identification.step)
    assert found["parameters"] == list(shown.estimate.identification.parameters.free_names)
    assert found["seed"] == [1]


def test_every_row_lies_in_its_phase_and_every_step_has_a_robot(opened, timeline):
    for phase in timeline.phases:
        assert phase.start <= phase.at[0]
        assert phase.at[-1] < phase.stop
        assert (np.diff(phase.at) > 0).all()
        entity = {"select": "/select/O1", "measure": "/measure/nominal"}.get(
            phase.name, {"identify": "/identify/fit", "evaluate": "/evaluate/after"}.get(phase.name)
        )
        assert np.array_equal(scalars(opened, entity)[0], phase.at)
    link = "/world/robot" + "".join(f"/link{k}" for k in range(1, 7))
    at, _ = column(opened, link, "Transform3D:translation")
    assert np.array_equal(at, np.arange(timeline.n_steps))


def drawn_tool(opened, timeline, root, tool):
    """Tool poses (s, 4, 4) from the nested transforms of the file."""
    T, path = np.eye(4), root
    for joint in range(1, 7):
        path += f"/link{joint}"
        x, y, z, w = np.array(column(opened, path, "Transform3D:quaternion")[1])[:, 0].T
        A = np.zeros((timeline.n_steps, 4, 4))
        A[:, 0, :3] = np.c_[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)]
        A[:, 1, :3] = np.c_[2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)]
        A[:, 2, :3] = np.c_[2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]
        A[:, :3, 3] = np.array(column(opened, path, "Transform3D:translation")[1])[:, 0]
        A[:, 3, 3] = 1
        T = T @ A
    return T @ tool


def test_the_drawn_robot_stands_where_forward_kinematics_says(opened, shown, timeline):
    chain = shown.setting.nominal.chain
    drawn = drawn_tool(opened, timeline, "/world/robot", placements(chain).tool)
    assert np.abs(drawn - forward(chain, timeline.q)).max() < SINGLE
    for phase, q in (
        (timeline.phase("measure"), shown.trial.measurements.q),
        (timeline.phase("evaluate"), shown.setting.test_q),
    ):
        assert np.abs(timeline.q[phase.at] - q).max() < 1e-14


def test_the_ghost_deviates_by_its_factor_before_and_after(opened, shown, timeline):
    """To first order: 50 times 0.02 deg is 1 deg, products of two such turns are some percent."""
    entity = next(
        line.split()[0] for line in opened.summary().splitlines() if "/world/true_x" in line
    )
    factor = int(re.search(r"true_x(\d+)", entity)[1])
    root = f"/world/true_x{factor}"
    chain = shown.setting.nominal.chain
    drawn = drawn_tool(opened, timeline, root, placements(chain).tool)[:, :3, 3]
    nominal, q = forward(chain, timeline.q)[:, :3, 3], timeline.q
    true = shown.setting.true.poses(q)[:, :3, 3]
    identified = shown.estimate.identification.model.poses(q)[:, :3, 3]
    for phase, stated, largest in (("measure", nominal, 0.06), ("evaluate", identified, 0.01)):
        steps = timeline.phase(phase).steps
        expected = factor * (true - stated)[steps]
        wrong = np.linalg.norm((drawn - nominal)[steps] - expected, axis=1)
        unit = factor * np.linalg.norm((true - nominal)[steps], axis=1).mean()
        assert wrong.mean() < largest * unit, phase


def test_the_smallest_equal_step_moves_the_tool_alike_and_drops_what_nobody_sees(shown):
    chain, q = shown.setting.nominal.chain, shown.setting.pool_q
    # d2 against d3: joints 2 and 3 are parallel, only the sum is seen
    step = np.zeros(42)
    step[6 + 5 + 1], step[6 + 10 + 1] = 1e-4, -1e-4
    assert np.abs(smallest_equal(chain, step, q)).max() < 1e-12
    step = np.random.default_rng(0).normal(scale=1e-6, size=42)
    small = smallest_equal(chain, step, q)
    moved = [forward(chain.moved(s), q) for s in (step, small)]
    # what remains is of second order in 1e-6
    assert np.abs(moved[0] - moved[1]).max() < 1e-10
    assert np.abs(smallest_equal(chain, small, q) - small).max() < 1e-15


def test_ghost_chains_start_at_the_truth(shown):
    (chain,) = ghost_chains(shown, 1, np.array([0.0]))
    assert np.abs(chain.links - shown.setting.true.chain.links).max() < 1e-15


def test_the_ghost_of_a_sprung_arm_is_bent_about_three_axes_by_its_factor(shown):
    """To first order of what is left of the truth, drawn once, as the sprung arm stands."""
    setting, robot = shown.setting, load_robot("staubli_tx60")
    springs = unmodelled_terms(robot, settings("elastic")).springs
    truth = TrueRobot(setting.true, np.zeros(6), UnmodelledTerms(springs=springs))
    sprung = replace(shown, arm=truth.simulator)
    q, nothing = setting.test_q, np.zeros(len(setting.test_q))
    bends = bends_left(sprung, q, nothing)
    assert 1e-4 < np.abs(bends[:, :, :2]).max() < 1e-3
    true = truth.poses(q)
    # springs at joints that are up to 2e-4 rad elsewhere: 2e-4 of a droop of a millimeter
    assert np.abs(bent_forward(setting.true.chain, q, bends) - true).max() < 2e-7
    identified = shown.estimate.identification.model.joint_errors.bends(q)
    np.testing.assert_allclose(
        bends - bends_left(sprung, q, nothing + 1), identified, rtol=0, atol=1e-18
    )
    pen = Drawn(None)
    draw_arm(pen, "arm", robot, q + 30 * bends[:, :, 2], (setting.true.chain,),
             across=30 * bends[:, :, :2])  # fmt: skip
    np.testing.assert_allclose(
        pen.tool("arm"), bent_forward(setting.true.chain, q, 30 * bends), rtol=0, atol=1e-12
    )


def test_the_ghost_hides_where_another_one_moves(shown, campaign):
    q = shown.setting.test_q[:3]
    timeline = timeline_of([*chapters_of(campaign), chapter("move", visit(q))])
    pen = Drawn(timeline)
    draw_ghost(shown, load_robot("staubli_tx60"), pen)
    away = pen.tool(f"world/true_x{shown.ghost}") - shown.setting.nominal.poses(timeline.q)
    size = np.abs(away).max(axis=(1, 2))
    assert size[timeline.phase("move").steps].max() < 1e-12
    assert size[timeline.phase("evaluate").steps].min() > 1e-5


class Drawn:
    """A pen that keeps the transforms of a TX60."""

    def __init__(self, timeline):
        self.timeline, self.drawn = timeline, {}

    def tool(self, root):
        """Tool poses of the arm that was drawn there."""
        T = np.eye(4)
        for joint in range(1, 7):
            T = T @ self.drawn[root + "".join(f"/link{k + 1}" for k in range(joint))]
        return T @ placements(load_robot("staubli_tx60").model.chain).tool

    def transforms(self, path, T):
        self.drawn[path] = T

    def static(self, path, what):
        pass


def test_of_very_many_parameters_the_first_have_a_row_that_can_be_read():
    assert parameter_panel(32).title == "Parameter error / stated u"
    few, many = parameter_panel(32), parameter_panel(426)
    assert (many.x, many.y, many.title) == (few.x, few.y, "Error / u: first 32 of 426")


def test_an_arrow_ends_inside_its_ellipsoid_exactly_where_the_record_says_so(opened, shown):
    judged, factor = shown.estimate.comparison, shown.regions
    path = f"/world/held_out/region_95_x{factor}"
    last = {
        name: np.array(column(opened, path, f"Ellipsoids3D:{name}")[1][-1])
        for name in ("half_sizes", "quaternions")
    }
    arrows = column(opened, f"/world/held_out/after_x{factor}", "Arrows3D:vectors")[1][-1]
    x, y, z, w = last["quaternions"].T
    vector = np.array(arrows)
    assert np.abs(vector - factor * judged.error).max() < SINGLE  # true minus identified
    # rotate the arrow into the ellipsoid's axes by the conjugate quaternion
    u = -np.stack([x, y, z], -1)
    t = 2 * np.cross(u, vector)
    local = vector + w[:, None] * t + np.cross(u, t)
    size = np.linalg.norm(local / last["half_sizes"], axis=1)
    assert np.array_equal(size <= 1, shown.estimate.inside)
    blue = np.array(column(opened, path, "Ellipsoids3D:colors")[1][-1]) >> 8 & 255 > 150
    assert np.array_equal(blue, shown.estimate.inside)
    belief = shown.estimate.belief
    C = belief.regions(shown.setting.test_q).covariance
    distance = np.einsum("ti,tij,tj->t", judged.error, np.linalg.pinv(C), judged.error)
    assert size == pytest.approx(np.sqrt(distance) / belief.factor, rel=1e-4)  # float32 axes
    # where nothing is believed, the regions are those of the fit, and hold what these hold
    nothing = replace(shown.estimate, statement=None)
    stated, moved = stated_regions(shown.setting, nothing, in_turn(shown.setting.test_q))
    assert moved is None
    assert stated.factor == coverage_factor(3)
    true = target_points(shown.setting.test_true, shown.setting.target)
    assert np.array_equal(stated.holds(true), nothing.inside)
    assert set(nothing.inside.tolist()) == {True, False}


def test_the_beam_follows_the_target_and_goes_out_after_the_last_pose(opened, shown, timeline):
    measure = timeline.phase("measure")
    at, strips = column(opened, "/world/beam", "LineStrips3D:strips")
    assert np.array_equal(at, measure.steps)
    ends = np.array(strips)[:, 0]
    assert np.abs(ends[:, 0] - shown.setting.T_world_tracker[:3, 3]).max() < SINGLE
    target = shown.setting.nominal.poses(timeline.q[measure.steps])[:, :3, 3]
    assert np.abs(ends[:, 1] - target).max() < SINGLE
    assert column(opened, "/world/beam", "Clear:is_recursive")[0].tolist() == [measure.stop]


def test_the_tracker_looks_along_its_beam(opened, shown, timeline):
    """The head's x axis, from the transforms in the file, points at the target."""
    axes = np.array([[1.0, 0, 0]])
    for name in ("yoke/head", "yoke"):
        x, y, z, w = np.array(
            column(opened, f"/world/tracker/{name}", "Transform3D:quaternion")[1]
        )[:, 0].T
        u = np.stack([x, y, z], -1)
        axes = np.broadcast_to(axes, u.shape)
        t = 2 * np.cross(u, axes)
        axes = axes + w[:, None] * t + np.cross(u, t)
    station = shown.setting.T_world_tracker
    beam = shown.setting.nominal.poses(timeline.q)[:, :3, 3] - station[:3, 3]
    beam = beam / np.linalg.norm(beam, axis=1, keepdims=True) @ station[:3, :3]
    assert np.abs(axes - beam).max() < SINGLE


def test_points_cleared_at_a_phase_end_do_not_linger(opened, timeline):
    for entity, step in (
        ("/world/chosen", timeline.phase("identify").stop),
        ("/world/measured", timeline.phase("identify").stop),
    ):
        assert column(opened, entity, "Clear:is_recursive")[0].tolist() == [step]


def test_final_parameter_points_are_errors_over_stated_uncertainty(opened, shown):
    found, judged = shown.estimate.identification, shown.estimate.comparison
    last = np.array(column(opened, "/parameters/error", "Points2D:positions")[1][-1])
    z = (judged.true_step - found.step) / found.standard_uncertainty
    away = last[:, 0] - middles(len(last))
    assert np.sinh(away / place(1.0) * np.arcsinh(1.0)) == pytest.approx(z, rel=1e-4, abs=1e-5)


def test_recording_twice_gives_the_same_content(path, tmp_path, opened, campaign):
    again = tmp_path / "again.rrd"
    again.write_bytes(bytes_of.__wrapped__(campaign))
    assert viewed.compare(path, again)
    assert structure(store(again)) == structure(opened)


def test_a_changed_number_is_noticed(path, tmp_path, campaign):
    trial = campaign.trials[0]
    judged = replace(
        trial.estimates[0].comparison, after=trial.estimates[0].comparison.after * 1.01
    )
    estimates = (replace(trial.estimates[0], comparison=judged), *trial.estimates[1:])
    other = with_records(campaign, **{trial.name: replace(trial, estimates=estimates)})
    assert not viewed.compare(path, record(tmp_path / "other.rrd", other))


def test_a_whole_file_verifies_and_a_cut_one_does_not(path, tmp_path):
    assert viewed.verify(path)
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(path.read_bytes()[:-4000])
    assert not viewed.verify(cut)


def test_structure_is_the_golden_one(opened):
    """Rewrite on purpose: python -m tests.testbed.run.test_recording; say why in the commit."""
    assert structure(opened) == GOLDEN.read_text(encoding="utf-8").splitlines()


def test_no_clock_of_this_machine_is_in_the_file(opened):
    assert "log_time" not in opened.summary()
    assert "log_tick" not in opened.summary()


def test_strict_mode_is_given_back_also_after_an_error():
    import rerun as rr

    before = rr.strict_mode()

    def fail():
        with strict_mode():
            assert rr.strict_mode()
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert rr.strict_mode() == before


def test_a_glide_starts_and_rests_at_its_stops():
    stops = np.array([[0.0], [1.0], [-2.0]])
    q = glide(stops, 18)
    assert np.array_equal(q[[4, 5, 10, 11, 16, 17]].ravel(), [0, 0, 1, 1, -2, -2])
    assert np.array_equal(q[0], stops[0])
    assert (np.diff(q[6:11, 0]) > 0).all()


@pytest.mark.parametrize("count", [1, 2, 299, 300, 301, 5000])
def test_a_growing_cloud_ends_complete_and_stays_small(count):
    lengths = growing(count)
    assert lengths[0] >= 1
    assert lengths[-1] == count
    assert (np.diff(lengths) > 0).all()
    assert len(lengths) == min(count, 300)


@pytest.mark.parametrize("typical", [0.5e-3, 0.39e-3, 1e-3, 7e-6, 3.0, 0.0])
def test_a_factor_is_round_and_stays_below_the_largest_size(typical):
    factor = nice_factor(0.04, typical)
    assert int(str(factor)[0]) in (1, 2, 3, 5)
    assert set(str(factor)[1:]) <= {"0"}
    assert factor == 1 or factor * typical <= 0.04 * (1 + 1e-12)
    assert typical in (0.0, 3.0) or 2.01 * factor * typical > 0.04


def test_a_box_has_twelve_edges_of_its_three_sizes():
    edges = box_edges(np.array([1.0, 2, 3]), np.array([0.1, 0.2, 0.3]))
    length = np.sort(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1))
    assert length == pytest.approx(np.repeat([0.1, 0.2, 0.3], 4))
    assert edges.reshape(-1, 3).mean(axis=0) == pytest.approx([1, 2, 3])


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        lines = structure(store(record(Path(folder) / "campaign.rrd")))
    GOLDEN.write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_a_campaign_without_any_search_is_recorded_too(tmp_path):
    """A random set was not searched for: its select phase shows its own index."""
    trial = [{"name": "only", "poses": 10, "method": "random"}]
    campaign = played("quick", {**SMALL, "trial": trial, "uncertainty.replications": 0})
    record(tmp_path / "only.rrd", campaign)
    assert viewed.verify(tmp_path / "only.rrd")
