"""plan_report.html: one self-contained page of a plan, what comes out of it first."""

from collections.abc import Mapping

from testbed.output.plan_report_cell import candidate_section, parameter_section, station_section
from testbed.output.plan_report_poses import number_section, order_section, prediction_section
from testbed.output.plan_words import (
    PROMISED,
    certificate_word,
    headline_rows,
    mark,
    next_step,
    promise,
    reasons,
    untested,
)
from testbed.output.report import BANNER, Page, render
from testbed.output.report_parts import Code, Section, Table, Text, versions_table
from testbed.planning.records import Plan
from testbed.robots.catalog import Robot
from testbed.scenario import dump_scenario


def plan_report_html(plan: Plan, robot: Robot, *, versions: Mapping[str, str]) -> str:
    """The report of a plan as one HTML page: no network, same bytes each time.

    Parameters
    ----------
    plan : Plan
        As `testbed.plan.plan` makes it.
    robot : Robot
        Its name for people.
    versions : mapping of str to str
        Program and packages.
    """
    scenario = plan.scenario
    page = Page(
        banner=BANNER,
        title=scenario.title or scenario.name,
        subtitle=f"Measuring plan {scenario.name}, seed {scenario.seed}, {robot.title}. Predicted "
        "from the nominal robot; nothing has been measured.",
        believable=not plan.tour.blocked and not untested(plan),
        mark=mark(plan),
        verdict=promise(plan),
        reasons=reasons(plan),
        headline=headline(plan),
        next_step=next_step(plan),
        sections=tuple(
            section
            for section in (
                order_section(plan),
                number_section(plan),
                prediction_section(plan),
                station_section(plan),
                candidate_section(plan),
                parameter_section(plan),
                record_section(plan, versions),
            )
            if section is not None
        ),
    )
    return render(page)


def headline(plan: Plan) -> Table:
    """What the plan asks for and what it promises."""
    return Table(
        caption="The plan in numbers",
        head=("what", "value", "unit"),
        rows=tuple(headline_rows(plan)),
        align="lrl",
        strong=PROMISED,
        note="u: standard uncertainty of the tool point, root of the sum over x, y, z. U = k u. It "
        "counts what the tracker and the joints scatter, through the numbers identified; it does "
        "not count what the model leaves out (sag, harmonics, backlash) nor the repeatability of "
        "the later move.",
    )


def record_section(plan: Plan, versions: Mapping[str, str]) -> Section:
    """What is needed to make the plan again."""
    table = versions_table(versions)
    text = (
        f"Seed {plan.scenario.seed}. Planning the scenario below again with the same versions "
        f"gives the same table. {certificate_word(plan)}"
    )
    return Section(
        "record", "Scenario and versions", (Text(text), table, Code(dump_scenario(plan.scenario)))
    )
