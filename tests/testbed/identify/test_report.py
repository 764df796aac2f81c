"""The page of a calibration: verdict first, every number that of the record, no network."""

import re
import tempfile
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from testbed.identify.records import Delivered
from testbed.identify.report import page_of
from testbed.identify.results import dh_table
from testbed.identify.words import (
    MEASURED,
    mark,
    next_step,
    notice,
    reasons,
    terminal_text,
    verdict,
)
from testbed.report.page import SIMULATED, render
from tests.calibrated import real, sound
from tests.reported import VERSIONS, read

DELIVERED = Delivered(("robot.toml has the robot's poses to 1e-15 m",), ("2 of 2 corrected",), 0)


@cache
def html(make):
    return render(page(make))


@cache
def page(make):
    return page_of(make(), DELIVERED, VERSIONS)


def test_the_page_opens_and_ends_with_where_its_numbers_come_from():
    reader = read(html(real))
    assert reader.open == []
    assert reader.text[0] == reader.text[-1] == MEASURED
    assert notice(sound()) == SIMULATED
    assert not reader.links or all(link.startswith("#") for link in reader.links)
    assert tempfile.gettempdir() not in html(real)


def test_what_is_not_valid_is_said_before_anything_else():
    shown = page(real)
    assert not shown.believable
    assert shown.mark.startswith("✗ Believe the held-out radius")
    # five times the stated noise, less what 56 numbers learn from 360 equations
    assert re.match(r"The residuals are [45]\.\d times what the stated noise", shown.reasons[0])
    assert shown.reasons[1].startswith("The model-based interval is not valid here")
    assert mark(sound()) == "✓ The stated uncertainty can be believed"
    assert "times what the stated noise" not in reasons(sound())[0]


def test_the_verdict_and_the_headline_are_the_held_out_figures():
    found, shown = real(), page(real)
    before, after = found.before_test, found.fit.test
    for value in (before.position.mean * 1e3, after.position.mean * 1e3):
        assert f"{value:.4f}" in shown.verdict
    for value in (before.rotation.mean, after.rotation.mean):
        assert f"{np.degrees(value):.4f}" in shown.verdict
    rows = shown.headline.rows
    assert [row[0] for row in rows] == [
        "nominal links, frames fitted",
        "geometric",
        "extended (chosen)",
    ]
    assert shown.headline.strong == (2,)
    assert rows[2][1] == f"{after.position.mean * 1e3:.4f}"
    assert rows[1][-1] == "30"


def test_every_number_of_the_robot_has_a_row_with_its_u_or_says_held():
    found, shown = real(), page(real)
    section = next(one for one in shown.sections if one.anchor == "parameters")
    table = section.blocks[1]
    names = found.fit.identification.model.names
    assert tuple(row[0] for row in table.rows) == names
    held = [row[0] for row in table.rows if row[-1] == "held"]
    assert set(held) == set(names) - set(found.fit.identification.names)
    a2 = next(row for row in dh_table(found) if row.name == "a2")
    place = found.fit.identification.names.index("a2")
    assert a2.expanded == pytest.approx(2e3 * np.sqrt(found.covariance[place, place]), rel=1e-12)


def test_sections_are_linked_and_drawn():
    text = html(real)
    reader = read(text)
    for section in page(real).sections:
        assert section.anchor in reader.ids
    assert text.count("<svg") == 6
    assert len(text) < 1_500_000


def test_the_terminal_says_the_same_in_plain_text():
    text = terminal_text(real(), DELIVERED)
    assert text.splitlines()[0] == MEASURED
    assert f"Verdict: {page(real).verdict}" in text
    assert "2 of 2 corrected." in text


def test_a_worse_model_is_not_said_to_fall_and_is_not_recommended():
    found = real()
    worse = replace(found.fit, test=found.before_test)
    turned = replace(found, before_test=found.fit.test, fits=(found.fits[0], worse))
    assert " RISES from " in verdict(turned)
    assert next_step(turned).startswith("Do not use this model")


def test_no_uncertainty_is_offered_where_the_stated_one_is_contradicted():
    found = real()
    assert "Quote" in next_step(found)
    assert "(95 %)" in next_step(found)
    bare = replace(found, proof=replace(found.proof, conformal=None))
    assert "Quote no uncertainty with it" in next_step(bare)
    assert "may be quoted" in next_step(sound())
    untested = replace(sound(), proof=replace(sound().proof, held_out=None))
    assert "No held-out pose has tested" in next_step(untested)


def test_rows_left_out_while_reading_are_said_on_the_first_screen():
    found = sound()
    masked = replace(found, source=replace(found.source, masked=("poses.csv:7: left out",)))
    assert not any("left out while reading" in text for text in reasons(found))
    assert any("left out while reading" in text for text in reasons(masked))
