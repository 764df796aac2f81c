"""How many files a reader has to know: counted while a scene is read and one trial is played."""

import json
import subprocess
import sys

import pytest

from tests.trace_quick import READ, ROOT

MOST = {READ: 26, "designed-29": 95, "random-29": 88}
"""Files entered: may only fall. The aim is 16 to read a scenario and 70 to play one trial."""


@pytest.fixture(scope="module")
def entered():
    """Files by stage, of a fresh interpreter: what is imported is entered, too."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.trace_quick", "--records", "--json"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return {
        stage: {*files["called"], *files["imported"]}
        for stage, files in json.loads(done.stdout).items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("stage", MOST)
def test_few_files_are_entered(entered, stage):
    assert len(entered[stage]) <= MOST[stage], "\n".join(sorted(entered[stage]))


@pytest.mark.slow
def test_reading_a_scenario_enters_no_study_and_no_picture(entered):
    assert "testbed/scenario/read.py" in entered[READ]
    assert not [file for file in entered[READ] if file.endswith(("play.py", "plots.py"))]
