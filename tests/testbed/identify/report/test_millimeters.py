"""Errors of millimeters, as motion capture reads them, are said in millimeters."""

import re
from dataclasses import replace
from functools import cache

import pytest

from testbed.identify.calibrate import Options, calibrate
from testbed.identify.decisions import decided_at, decision_section, decision_words
from testbed.identify.report import plots
from testbed.identify.report.page import page_of
from testbed.identify.words import terminal_text
from testbed.report.page import Table, render
from testbed.scenario.systematic import SystematicTable
from testbed.scenario.tolerance import Decision
from testbed.scenario.tool_in_use import ToolInUse
from tests.calibrated import robot, session_of, table_of, true_model
from tests.reference import SIGMA_POSITION, pool_r
from tests.reported import THOUSANDS, VERSIONS, read
from tests.testbed.identify.test_report import DELIVERED, lines_of

LOUD = 1.5e-3 / SIGMA_POSITION
"""Times the noise of a tracker."""
GRIPPER = ToolInUse("gripper", (0.0, 0.0, 0.15), (0.0, 0.0, 0.0), 2e-3)


@cache
def loud(*, assumed=False):
    """Ninety poses that are read with 1.5 mm of noise, which is stated; or else nobody knows it."""
    true, nominal = true_model(), robot().model.chain.links
    links = nominal + 8 * (true.chain.links - nominal)  # enough to be better than the nominal arm
    seen = table_of(replace(true, chain=replace(true.chain, links=links)), pool_r(90), noise=LOUD)
    if not assumed:
        seen = replace(seen, covariance=LOUD**2 * seen.covariance)
    session = session_of(
        seen, systematic=SystematicTable(target_offset_um=1500), in_use=GRIPPER,
        decision=Decision(20e-3, "guarded"), noise_assumed=assumed,
    )  # fmt: skip
    return calibrate(robot(), session, Options(seed=1, held_out=30))


@pytest.mark.parametrize("assumed", [False, True])
def test_neither_the_screen_nor_the_page_names_thousands_of_micrometers(assumed):
    found = loud(assumed=assumed)
    mean, move = found.proof.point.radius_mean, found.proof.point.radius_move
    assert mean > 1e-3
    said = terminal_text(found, DELIVERED)
    radius = [f"{1e3 * size:#.3g}" for size in (mean, move)]
    assert f"of the mean tool point is {radius[0]} mm" in " ".join(said.split())
    assert f"R95 = {radius[0]} mm for the mean of many moves" in said
    assert f"and {radius[1]} mm for a single move" in said
    text = " ".join(read(render(page_of(found, DELIVERED, VERSIONS))).text)
    assert THOUSANDS.findall(said) == THOUSANDS.findall(text) == []


def test_a_column_of_micrometers_is_one_of_millimeters_where_its_largest_asks_for_it():
    page = page_of(loud(), DELIVERED, VERSIONS)
    tables = [block for part in page.sections for block in part.blocks if isinstance(block, Table)]
    heads = {head: (table, k) for table in tables for k, head in enumerate(table.head)}
    for head in ("R95\u00a0mm", "at the tool mm", "R95 mm, median", "R95 mm, largest"):
        table, k = heads[head]
        assert all(0.1 < float(row[k]) < 50 for row in table.rows)
    assert not any(re.search(r"\b[uµ]m\b", head) for head in heads)


def test_a_tolerance_and_what_is_held_against_it_are_in_one_unit():
    (first, *_) = decision_words(loud(), DELIVERED)
    assert first.startswith("Tolerance 20 mm: ")
    (table, _) = decision_section(decided_at(loud(), DELIVERED)).blocks
    assert "Tolerance 20 mm on the distance" in table.caption
    assert table.head[-2] == "guard band R95 mm"


@pytest.mark.parametrize(("part", "side"), [(0.3, "left"), (0.95, "right")])
def test_the_radius_is_named_where_the_picture_has_room(part, side, monkeypatch):
    found = loud()
    axes = lines_of(monkeypatch, plots.histogram, found)
    top = max(bar.get_x() + bar.get_width() for bar in axes[0].patches)
    point = replace(found.proof.point, radius_mean=1e-3 * part * top)
    found = replace(found, proof=replace(found.proof, point=point))
    axes = lines_of(monkeypatch, plots.histogram, found)
    (named,) = [text for text in axes[0].texts if text.get_text().startswith("R95 ")]
    assert named.get_horizontalalignment() == side
    assert named.get_text() == f"R95 {part * top:#.3g} mm"
