"""Models and scenes are found in a checkout and in an installed package."""

from pathlib import Path

from testbed import assets


def test_the_checkout_has_the_scenes_and_the_robot():
    assert {"quick", "wen2022", "position_only"} <= set(assets.scene_names())
    assert (assets.models() / "staubli_tx60" / "robot.toml").is_file()


def test_an_installed_package_carries_its_own_copy(tmp_path, monkeypatch):
    for name in ("models", "scenes"):
        (tmp_path / "testbed" / name).mkdir(parents=True)
    (tmp_path / "testbed" / "scenes" / "one.toml").write_text("")
    monkeypatch.setattr(assets, "_HERE", tmp_path / "testbed")
    assert assets.models() == tmp_path / "testbed" / "models"
    assert assets.scene_names() == ["one"]


def test_robots_and_scenes_agree_on_where_models_lie():
    from testbed.robots.catalog import load_robot

    assert load_robot("staubli_tx60").folder == assets.models() / "staubli_tx60"
    assert Path(assets.scenes()).name == "scenes"


def test_lists_say_what_scenes_and_robots_are_once_they_are_checked():
    from testbed.robots.catalog import load_robot
    from testbed.studies import load_scenario

    for name, *said in assets.scene_rows():
        scene = load_scenario(name)
        assert said == [scene.robot, scene.title, [trial.name for trial in scene.trial]]
    for name, *said in assets.robot_rows():
        robot = load_robot(name)
        assert said == [robot.title, str(robot.model.chain.n_joints), str(robot.folder)]
