"""A plan for a tracker that is off by millimeters promises millimeters."""

import re
from functools import cache

from testbed.plan.plan import plan
from testbed.plan.promises import promise
from testbed.plan.recording import plan_story
from testbed.plan.report import plan_report_html
from testbed.plan.words import headline_rows, terminal_text
from tests.planned import QUICK, ROBOT, few_points, scenario
from tests.reported import THOUSANDS, VERSIONS, read

LOUD = {"tracker.range_um": [3000.0, 0.0], "tracker.transverse_um": [3000.0, 0.0]}


@cache
def loud():
    """Eight poses read with 3 mm of noise."""
    with few_points():
        return plan(scenario(QUICK, **LOUD))


def test_a_loud_plan_names_no_thousands_of_micrometers():
    made = loud()
    R95 = made.foresight.R95_over
    assert R95 > 1e-3
    assert f"within {1e3 * R95:#.3g} mm" in promise(made)
    text = " ".join(read(plan_report_html(made, ROBOT, versions=VERSIONS)).text)
    for said in (terminal_text(made), promise(made), made.proof.sentence, text):
        assert THOUSANDS.findall(said) == []
    assert re.search(r"U = \d+\.\d+ mm \(.*this set reaches \d+\.\d+ mm", made.proof.sentence)
    row = {what: (value, about) for what, value, about in headline_rows(made)}
    for what in ("R95 over the postures of the goal", "standard uncertainty u at the goal",
                 "smallest misfit that would show"):  # fmt: skip
        value, about = row[what]
        assert about.startswith("mm")
        assert 0.1 < float(value) < 1000


def test_its_recording_counts_in_millimeters():
    _, *chapters = plan_story(loud(), ROBOT).chapters
    for chapter in chapters:
        (chart,) = chapter.charts
        assert chart.title.startswith("U [mm]")
        assert all(re.search(r"\d mm$|too few for a U$", line) for line in chapter.lines)
