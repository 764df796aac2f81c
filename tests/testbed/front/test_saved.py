"""Single results in files of their own, changed scenes, exports and written robots."""

import numpy as np
import pytest

import calib
import truebed
from calib.compensation import corrected_poses
from calib.errors import InputError
from testbed.store.npz import record_bytes
from truebed.saved import HOMES, WHOLE

ROBOT = truebed.robot("staubli_tx60")


def measured(kind, m=60):
    """Readings of another arm than the nominal one, of a kind."""
    rng = np.random.default_rng(5)
    arm = ROBOT.model.moved(rng.normal(scale=2e-4, size=ROBOT.model.n_numbers))
    q = rng.uniform(-1.5, 1.5, (m, 6))
    T = arm.poses(q)
    if kind == "points":
        return calib.points(q, T[:, :3, 3] + rng.normal(scale=1e-5, size=(m, 3)), sd=1e-5)
    return calib.poses(q, T, sd=[1e-5, 1e-5])


def results(kind):
    """One result of each sort that a file can hold."""
    train, test = measured(kind).split(held_out=20, seed=0)
    found = calib.calibrate(ROBOT.model, train)
    q, rng, design = test.q, np.random.default_rng(0), calib.design
    problem = design.Problem.of_poses(ROBOT.model, q, poses=10, criterion="V", goals=q[:3])
    next_one = design.Problem.of_poses(ROBOT.model, q, poses=1, given=range(8))
    best = design.exchange(problem, rng, restarts=1)
    start, model, fit = found.start.model, found.model, found.identification
    limits = np.tile([-3.0, 3.0], (6, 1))
    return (
        train, found, fit, found.judge(test), model.chain, model, best, best.certificate,
        calib.compensate(start, model, q[:3]),
        corrected_poses(start, model, start.poses(q[:3]), q[:3], limits),
        design.pose_budget(problem, 1e-5, rng, counts=[8, 10], restarts=1),
        design.pose_count(problem, rng, sets=2)[0], design.best_next(next_one),
        design.random_sets(problem, rng, sets=2), calib.Prior([0.0], [1e-3], ["d1"]),
        calib.uncertainty.tool_statement(model, q, fit.full_covariance),
        calib.uncertainty.bootstrap(model, train, fit.parameters, rng, replicates=100),
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["points", "poses"])
def test_what_is_saved_comes_back_bit_for_bit(tmp_path, kind):
    """Its packed bytes are every array and number of it, so equal bytes are an equal result."""
    seen = set()
    for one in results(kind):
        truebed.save(one, tmp_path / "one.npz")
        again = truebed.load(tmp_path / "one.npz")
        name = type(one).__name__
        assert type(again) is type(one)
        assert record_bytes(name, again, WHOLE) == record_bytes(name, one, WHOLE)
        assert repr(again) == repr(one)
        seen.add(name)
        with np.load(tmp_path / "one.npz", allow_pickle=False) as file:
            assert all(file[key].dtype.kind in "biufU" for key in file.files)
    assert seen == set(HOMES)


def test_a_loaded_calibration_judges_as_the_one_that_was_saved(tmp_path):
    train, test = measured("points").split(held_out=20, seed=0)
    found = calib.calibrate(ROBOT.model, train)
    truebed.save(found, tmp_path / "found.npz")
    one, other = found.judge(test), truebed.load(tmp_path / "found.npz").judge(test)
    assert one.point.radius_mean == other.point.radius_mean


def test_what_cannot_be_saved_or_loaded_says_so(tmp_path):
    model, path = ROBOT.model, tmp_path / "one.npz"
    with pytest.raises(
        InputError, match="Robot cannot be saved here; expected one of Bootstrap, Cal"
    ):
        truebed.save(ROBOT, path)
    with pytest.raises(InputError, match=r"is not the name of an .npz file; write one.npz"):
        truebed.save(model, tmp_path / "one.pkl")
    truebed.save(model, path)
    whole = path.read_bytes()
    place = whole.index(model.chain.links.tobytes())
    path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
    with pytest.raises(InputError, match=r"one.npz: cannot be read: .*; give a folder that"):
        truebed.load(path)
    path.write_bytes(record_bytes("RobotModel", model, "a scenario's hash"))
    with pytest.raises(InputError, match=r"holds no result that truebed.save wrote"):
        truebed.load(path)
    path.write_bytes(record_bytes("Chain", model, WHOLE))
    with pytest.raises(InputError, match=r"was saved by another version: .*; save it again"):
        truebed.load(path)


def test_a_scene_is_changed_by_its_keys():
    scene = truebed.scene("quick", {"seed": 7, "truth.preset": "soft"})
    assert (scene.seed, scene.truth.preset) == (7, "soft")
    assert truebed.scene(scene).seed == 7
    assert truebed.scene("quick").truth.preset == "rigid"
    with pytest.raises(InputError, match=r'\[truth\] has no key "presett"; did you mean "preset"'):
        truebed.scene("quick", {"truth.presett": "soft"})


def test_an_exported_campaign_is_calibrated_without_its_rooms(tmp_path, campaign):
    truebed.export(campaign, tmp_path / "files")
    session = truebed.load(tmp_path / "files")
    assert (~session.is_test).sum() >= len(campaign.trials[0].measurements)
    with pytest.raises(InputError):
        truebed.export(campaign, tmp_path / "files")
    truebed.export(campaign, tmp_path / "files", overwrite=True)


def test_a_robot_is_written_with_numbers_from_arrays(tmp_path):
    found = calib.calibrate(ROBOT.model, measured("poses"))
    told = truebed.write_robot("staubli_tx60", found, tmp_path / "found")
    again = truebed.load(tmp_path / "found")
    q = np.random.default_rng(1).uniform(-1, 1, (20, 6))
    # robot.toml writes decimals of mm and degrees: 17 digits of them are not the same bits
    np.testing.assert_allclose(again.model.poses(q), found.model.poses(q), atol=1e-12)
    assert any(".urdf (yourdfpy) has the robot's poses" in one for one in told)
    other = truebed.robot("kuka_iiwa7")
    with pytest.raises(InputError, match="those of kuka_iiwa7"):
        truebed.write_robot(other, found.model, tmp_path / "no")


def test_what_the_verbs_give_has_a_name_for_annotations(campaign):
    for name in truebed.KINDS:
        assert isinstance(getattr(truebed, name), type), name
    assert isinstance(campaign, truebed.Campaign)
    assert isinstance(campaign.scenario, truebed.Scenario)
    assert isinstance(ROBOT, truebed.Robot)
    with pytest.raises(AttributeError) as caught:
        truebed.Campaigns  # noqa: B018
    assert (caught.value.name, caught.value.obj) == ("Campaigns", truebed)
