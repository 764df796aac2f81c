"""What a corrected program needs is said with the next step: its frame, and its tool."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from testbed.identify.calibration import FRAMES
from testbed.identify.handback.delivered import Delivered
from testbed.identify.report.page import page_of
from testbed.identify.to_do import program
from testbed.identify.to_do.program import program_step
from testbed.identify.words import terminal_text
from tests.calibrated import sound
from tests.reported import VERSIONS, undrawn

CORRECTED = Delivered((), ("2 of 2 corrected",), 0)
FRAME = "Corrected targets hold in the base of robot/robot.toml"


def test_the_frame_of_corrected_targets_is_said_on_terminal_and_report():
    found = replace(sound(), own_frames=False)
    told = " ".join(terminal_text(found, CORRECTED).split())
    assert FRAME in told.partition("To do: ")[2].partition("Program:")[0]
    with undrawn():
        assert FRAME in page_of(found, CORRECTED, VERSIONS).next_step
    assert program_step(found, Delivered((), (), 0)) == ""
    # measured in the robot's own base: nothing else could be meant
    assert program_step(replace(found, own_frames=True), CORRECTED) == ""
    # and no advice on a program while something has to be settled first
    assert program_step(replace(found, doubted=(FRAMES,)), CORRECTED) == ""


def test_the_radius_to_quote_at_targets_is_said_first():
    """It may be of another point than R95 of the measured target, and many times as large."""
    stated = np.array([True, False, True])
    radii = np.array([1.684e-3, 0.0, 1.7e-3])
    targets = SimpleNamespace(stated=stated, radius_mean=radii, before=None, after=None)
    step = program_step(sound(), replace(CORRECTED, targets=targets))
    assert step.startswith("At the targets of the program quote R95 = 1.68 to 1.70 mm. Corrected ")
    none = SimpleNamespace(stated=~stated & False, radius_mean=radii, before=None, after=None)
    assert program_step(sound(), replace(CORRECTED, targets=none)).startswith("Corrected targets")


@pytest.mark.parametrize("other", [True, False])
def test_a_program_of_a_tool_that_nobody_measured_is_told_what_would_decide_it(other, monkeypatch):
    decided = [
        SimpleNamespace(key="held_out_after", word="PASS"),
        SimpleNamespace(key="program_after", word="UNDECIDED"),
    ]
    monkeypatch.setattr(program, "decided_at", lambda *_: decided)
    monkeypatch.setattr(program, "tool_words", lambda _: ("for the tool of the file",) * other)
    step = program_step(sound(), CORRECTED)
    assert ("moves another tool than the measured target: measure that tool" in step) == other
    in_use = replace(sound().handback, in_use=SimpleNamespace())
    step = program_step(replace(sound(), handback=in_use), CORRECTED)
    assert "moves another tool than the measured target" in step
    decided[0].word = "UNDECIDED"  # then it is not the tool alone
    assert "another tool" not in program_step(sound(), CORRECTED)
