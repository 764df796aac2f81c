"""What a calibration says of the conditions it was measured under."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from calib.geometry.operating import OperatingConditions
from calib.uncertainty.statement.conditions import Conditions, Tolerance
from testbed.files.conditions import SetUp
from testbed.identify import moved
from testbed.identify.conditions import conditions_words, held_out_warnings, measured
from testbed.identify.moved import moved_in
from testbed.identify.report.page import page_of
from testbed.identify.to_do.next_step import next_step
from testbed.identify.to_do.program import program_step
from testbed.identify.words import terminal_text
from testbed.jobsheet.sheet import Instrument, JobSheet
from testbed.scenario.tolerance import Decision
from testbed.units import plain
from tests.calibrated import robot, session_of, sound, sound_session, table_of, true_model
from tests.reference import pool_r
from tests.reported import VERSIONS, undrawn
from tests.testbed.identify.test_report import DELIVERED

M = len(sound_session().measurements)
PAYLOAD, TOOLS, WARMTH = np.full(M, 2.5), ("probe",) * M, np.linspace(20.1, 23.4, M)
WORDS = {
    "nothing": (
        Conditions(),
        SetUp(),
        "Payload, tool and temperature are not stated: the results hold as long as they stay the "
        "same.",
    ),
    "all": (
        Conditions(PAYLOAD, TOOLS, WARMTH),
        SetUp(
            date="2026-11-22",
            stations=("S1", "S2"),
            job=JobSheet(instrument=Instrument("AT960", "750123")),
        ),
        "Measured with a payload of 2.5 kg and the tool probe at 20.1 to 23.4 degC by AT960 "
        "(serial number 750123) from stations S1 and S2 on 2026-11-22.",
    ),
    "a tool alone": (
        Conditions(tool=TOOLS),
        SetUp(),
        "Measured with the tool probe. Payload and temperature are not stated: the results hold as "
        "long as they stay the same.",
    ),
    "all but warmth": (
        Conditions(PAYLOAD, TOOLS),
        SetUp(stations=("S1",)),
        "Measured with a payload of 2.5 kg and the tool probe from station S1. Temperature is "
        "not stated: the results hold as long as it stays the same.",
    ),
}


@pytest.mark.parametrize("case", WORDS)
def test_the_conditions_stand_after_the_next_step(case):
    conditions, set_up, words = WORDS[case]
    found = replace(sound(), conditions=conditions, set_up=set_up)
    assert conditions_words(found) == words
    assert words in terminal_text(found, DELIVERED)
    if case != "all":  # a page takes a second
        return
    found = replace(found, decision=Decision(1e-3, "guarded"))
    with undrawn():
        page = page_of(found, DELIVERED, VERSIONS)
    assert " Tolerance 1 mm: " in plain(page.verdict)  # the decision stands on the first screen
    assert [section.anchor for section in page.sections][-3:] == ["job", "words", "record"]
    told = " ".join([next_step(found), program_step(found, DELIVERED), words])
    assert plain(page.next_step).startswith(f"{told} Systematic errors of")


def test_rows_that_took_no_part_do_not_count():
    found = sound()
    later = found.split.is_train & (np.arange(len(found.measurements)) % 7 == 0)
    split = replace(found.split, is_train=found.split.is_train & ~later)
    payload = np.where(later, 9.0, 0.0)
    other = replace(found, split=split, conditions=Conditions(payload=payload))
    assert later.any()
    assert measured(other).words("payload") == "0 kg"


def test_who_judges_under_other_conditions_is_said():
    is_test = np.arange(8) >= 5
    payload = np.where(np.arange(8) == 7, 5.0, 0.0)
    tool = ("probe",) * 5 + ("gripper",) * 3
    warmth = np.where(is_test, 26.0, np.linspace(20, 22, 8))
    ending = ": they judge the calibration under other conditions than those it was made under"
    said = held_out_warnings(Conditions(payload, tool, warmth), SetUp(), ~is_test, is_test)
    assert [text.removesuffix(ending) for text in said] == [
        "1 held-out row carries 5 kg; the training rows had a payload of 0 kg",
        "3 held-out rows have the tool gripper; the training rows had the tool probe",
        "3 held-out rows are at 26 degC; the training rows were at 20 to 21.14 degC",
    ]
    wide = SetUp(tolerance=Tolerance(5.0, 5.0))
    (only,) = held_out_warnings(Conditions(payload, tool, warmth), wide, ~is_test, is_test)
    assert "gripper" in only
    none = np.zeros(8, dtype=bool)
    assert held_out_warnings(Conditions(payload, tool, warmth), SetUp(), ~none, none) == ()
    assert held_out_warnings(Conditions(), SetUp(), ~is_test, is_test) == ()


@pytest.mark.parametrize(("payload", "asked"), [(None, "chosen plain"), (5.0, "chosen")])
def test_a_model_that_cannot_follow_what_rows_state_is_not_asked_what_moved(
    payload, asked, monkeypatch
):
    """A load from some row on bends the arm there: of geometry alone that is a step."""
    table = table_of(true_model(), pool_r(20))
    if payload is not None:
        load = np.where(np.arange(20) < 10, 0.0, payload)
        table = replace(table, conditions=OperatingConditions(payload=load))
    said = []
    monkeypatch.setattr(moved, "moved_or_back", lambda fit, *_, **__: said.append(fit))
    models = [SimpleNamespace(identification=name) for name in ("chosen", "plain")]
    found = moved_in(session_of(table), robot().model, models, table, np.ones(20, dtype=bool))
    assert found is None
    assert " ".join(said) == asked
