"""The words of a plan's recording: the summary, and what each phase shows."""

from testbed.output.plan_words import PROMISED, certificate_word, headline_rows, minutes, promise
from testbed.output.quantities import counted
from testbed.output.recording_plan_cell import reasons_shown
from testbed.output.recording_plan_story import PlanPhaseName, PlanStory
from testbed.output.recording_writer import Color, Pen
from testbed.output.results import SIMULATED
from testbed.planning.records import Plan

PHASE_COLORS: dict[PlanPhaseName, Color] = {
    "candidates": (128, 104, 98),
    "budget": (150, 110, 190),
    "tour": (52, 128, 196),
    "goal": (58, 140, 72),
}


def draw_texts(writer: Pen[PlanStory]) -> None:
    """The summary at all times, the explanation of each phase when it begins."""
    import rerun as rr

    markdown = rr.MediaType.MARKDOWN
    writer.static("summary", rr.TextDocument(summary(writer.story.plan), media_type=markdown))
    writer.static(
        "phase",
        rr.StateConfiguration(values=list(PHASE_COLORS), colors=list(PHASE_COLORS.values())),
    )
    for phase in writer.story.phases:
        text = explanation(writer.story, phase.name)
        writer.at(phase.start, "now", rr.TextDocument(text, media_type=markdown))
        writer.at(phase.start, "phase", rr.StateChange(state=phase.name))


def summary(plan: Plan) -> str:
    """The promise first, then the plan in numbers."""
    scenario = plan.scenario
    lines = [
        f"#### {scenario.title or scenario.name}",
        f"**{SIMULATED}** (plan of {scenario.name}, seed {scenario.seed})",
        "",
        promise(plan),
        "",
        "| | | |",
        "|---|--:|---|",
        *(
            f"| {what} | {value} | {unit} |"
            for k, (what, value, unit) in enumerate(headline_rows(plan))
            if k not in PROMISED
        ),
    ]
    return "\n".join(lines)


def explanation(story: PlanStory, phase: PlanPhaseName) -> str:
    """What is on the screen in a phase, in a few lines."""
    plan = story.plan
    pool, tour, k = plan.pool, plan.tour, plan.scenario.plan.coverage
    if phase == "candidates":
        shown = reasons_shown(plan)
        refused = [
            f"- refused, {name}: {int(count)}" + (f" ({shown[name][0]})" if name in shown else "")
            for name, count in zip(pool.rejection_names, pool.rejection_counts, strict=True)
            if count
        ]
        lines = [
            f"#### 1 Candidates: {len(pool.q)} of {pool.n_drawn} drawn",
            "- purple over green to yellow: the pool, with growing leverage",
            *refused,
            "- refused ones are shown inside the box only, at most 100 of each",
        ]
    elif phase == "budget":
        lines = [
            "#### 2 Number of poses",
            f"- blue curve: predicted U (k = {k:g}) of designed sets",
            "- vermilion: no set of that size goes below; gray: random sets, amber: target"
            if plan.curve.target is not None
            else "- vermilion: no set of that size goes below; gray: random sets",
            f"- from {plan.curve.counts[0]} to {plan.curve.counts[-1]} poses",
            f"- {plan.curve.sentence or plan.proof.sentence}",
            f"- {certificate_word(plan)}",
        ]
    elif phase == "tour":
        lines = [
            f"#### 3 Tour: {counted(len(tour), 'pose')} in {minutes(tour.duration)}",
            "- numbers: measuring order; blue: to identify from, orange: held out",
            "- line: the way of the tool; red: the beam",
            f"- {tour.sentence}",
        ]
    else:
        lines = [
            f"#### 4 Goal: {plan.goal.sentence}",
            "- purple over green to yellow: tool points of the goal, with growing uncertainty",
            f"- U (k = {k:g}): RMS {k * plan.u_mean * 1e6:.3g} µm, "
            f"worst {k * plan.u_worst * 1e6:.3g} µm",
        ]
    return "\n".join(lines)
