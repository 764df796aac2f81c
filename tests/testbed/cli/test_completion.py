"""What a shell is told when someone presses Tab: names of scenes and robots, soon."""

import pytest
from typer.testing import CliRunner

from testbed.assets import robot_names, scene_names
from testbed.cli import app
from testbed.schemas.files import FILES
from tests.fresh import python


def completed(line):
    """The words offered for the last word of a command line, as bash asks for them."""
    asked = {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" ")),
             "_TRUEBED_COMPLETE": "complete_bash"}  # fmt: skip
    return CliRunner().invoke(app, prog_name="truebed", env=asked).stdout.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("truebed run wen", ["wen2022", "wen2022_moving", "wen2022_reexamined"]),
        ("truebed run ", scene_names()),
        ("truebed plan plan", ["plan_tx60"]),
        ("truebed scenes qu", ["quick"]),
        ("truebed robots ", robot_names()),
        ("truebed identify k", ["kuka_iiwa7"]),
        ("truebed new scene u", ["universal_ur10"]),
        ("truebed check data.csv --robot s", ["staubli_tx60"]),
        ("truebed schema ", list(FILES)),
        ("truebed rep", ["report"]),
        ("truebed run quick --wo", ["--workers"]),
        ("truebed run ./my", []),  # files are the shell's own
    ],
)
def test_tab_completes_verbs_options_scenes_and_robots(line, offered):
    assert completed(line) == offered


def test_a_shell_has_its_answer_without_a_heavy_library():
    done = python(
        "-X", "importtime", "-m", "testbed", check=False,
        COMP_WORDS="truebed run q", COMP_CWORD="2", _TRUEBED_COMPLETE="complete_bash",
    )  # fmt: skip
    assert done.stdout == "quick\n"
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "typer" in loaded
    heavy = {"numpy", "scipy", "mujoco", "rerun", "matplotlib"}
    assert not heavy & {name.split(".")[0] for name in loaded}


def test_a_home_that_cannot_be_written_is_told_by_its_name():
    done = python(
        "-m", "testbed", "--install-completion", check=False, HOME="/proc/nobody", SHELL="/bin/bash"
    )
    assert "stdout" not in done.stderr
    assert "Traceback" not in done.stderr
    assert done.returncode != 0
