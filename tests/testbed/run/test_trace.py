"""How many files a reader has to know: counted while a scene is read and one trial is played."""

import json

import pytest

from tests.fresh import python
from tests.trace_quick import READ

CALLED = {READ: 28, "designed-29": 159, "random-29": 156}
"""Files of which a function runs: may only fall, but for a module that is split because it had two
subjects (what [truth] may not say, what is assumed of a robot, the likelihood of a misfit and the
systems it solves, the circumstances and the setting of a campaign, the tracker of a scenario, the
conditions of a row, the links of a robot, what kind of file one is, what is believed and how that
comes about, where it applies and the steps that joints keep, what all
readings of an instrument share, what an arm can hit and how its parts
are written, which rows belong together, how lengths are said, what of a record nobody has taken yet
have files of their own), for loops in numpy (of which a tracer sees more than of compiled ones),
for replications computed together as arrays (11 files beside the single fit, their oracle), for
gates that every path, TOML file and mesh passes, for the doors of the design (4 files: what is a
problem, a place or a count, and what an error says), and for what a statement must know (23 files:
the misfit that may hide, what counted errors say of it, poses that stand out, loud angles, growth,
repeats, frames, which one is shown and what a motion leaves, drift, radii, which point is stated,
long tails). The aim was 16 to read a scene, 70 for a trial; of a trial's files 78 are calib's,
which keeps each idea in a file of its own."""
IMPORTED = {READ: 9}
"""Files that are imported for it, beyond what the runner has imported before: may only fall."""


@pytest.fixture(scope="module")
def stages():
    """Files by stage and by how they are entered, of a fresh interpreter."""
    return json.loads(python("-m", "tests.trace_quick", "--records", "--json").stdout)


@pytest.mark.slow
@pytest.mark.parametrize("stage", CALLED)
def test_few_files_are_called(stages, stage):
    assert len(stages[stage]["called"]) <= CALLED[stage], "\n".join(stages[stage]["called"])


@pytest.mark.slow
@pytest.mark.parametrize("stage", IMPORTED)
def test_few_files_are_imported(stages, stage):
    assert len(stages[stage]["imported"]) <= IMPORTED[stage], "\n".join(stages[stage]["imported"])


@pytest.mark.slow
def test_reading_a_scene_enters_no_study_and_no_picture(stages):
    entered = [*stages[READ]["called"], *stages[READ]["imported"]]
    assert "testbed/scenario/read.py" in entered
    assert not [file for file in entered if file.endswith(("play.py", "plots.py"))]
