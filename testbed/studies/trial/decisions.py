"""Decisions whether tool points conform to the tolerance of a scenario, and how many are wrong.

Decisions use what the calibration states; afterwards they are compared with the truth.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib.geometry.frames import target_points
from calib.measurement.accuracy import point_distances
from calib.uncertainty.statement.conformity import Conformity, conformity
from calib.uncertainty.statement.stated_point import widened
from testbed.laboratory.truth.setting import held_out_conditions
from testbed.lengths import as_stated, column_unit
from testbed.report.page import Section, Table, Text, heads
from testbed.scenario.tolerance import Decision
from testbed.store.quantities import METRE, Quantity, below, stated
from testbed.studies.trial.records import Campaign, Estimate
from testbed.studies.trial.statement.records import LEVEL
from testbed.units import counted, percent, sentence, significant, typeset

PROGRAMS = {"before": "as it was", "after": "corrected"}


@dataclass(frozen=True, slots=True, eq=False)
class JudgedDecisions:
    """Decisions at the held-out poses, for the original program or the corrected one."""

    made: Conformity
    wrong: int
    """Truth: number of passes with the true point out of tolerance, and of fails with it within."""


def decide(campaign: Campaign, estimate: Estimate) -> dict[str, JudgedDecisions]:
    """Decisions on one calibration; none without a tolerance, or if nothing is believed.

    With the original program the robot gets joints of the nominal model, and the identified model
    predicts its deviation; with the corrected one no deviation is predicted.
    """
    settings, setting = campaign.scenario.tolerance, campaign.setting
    belief = estimate.belief
    if settings is None or belief is None:
        return {}
    q, target, by = setting.test_q, setting.target, settings.decision
    stated = belief.regions(q, target=target, at=held_out_conditions(campaign.scenario, q))
    nominal = target_points(setting.nominal.poses(q), target)
    true = target_points(setting.test_true, target)
    unreached = belief.proven.applies(q).place == "outside"
    found = {}
    for name, at in (("before", nominal), ("after", stated.position)):
        made = conformity(
            stated.position - at, widened(stated), by.tolerance, rule=by.rule, probability=LEVEL
        )
        outcome = np.where(unreached, "undecided", made.outcome)
        within = point_distances(true, at) <= by.tolerance
        wrong = (outcome == "pass") & ~within | (outcome == "fail") & within
        found[name] = JudgedDecisions(replace(made, outcome=outcome), int(wrong.sum()))
    return found


def decision_section(campaign: Campaign) -> Section | None:
    """Pass, fail or no decision at the held-out poses; None in a scenario without a tolerance."""
    settings = campaign.scenario.tolerance
    if settings is None:
        return None
    rows = []
    decided = [
        (trial, name, found)
        for trial, estimate in campaign.estimates
        for name, found in decide(campaign, estimate).items()
    ]
    guards = [float(np.median(found.made.guard)) for *_, found in decided]
    scale, unit = column_unit(guards)
    for guard, (trial, name, found) in zip(guards, decided, strict=True):
        made, counts = found.made, found.made.counts
        rows.append(
            (
                trial.name if name == "before" else "",
                PROGRAMS[name],
                *(str(counts.get(word, 0)) for word in ("pass", "undecided", "fail")),
                significant(guard * scale) if guard else "none",
                "–" if made.largest_risk is None else percent(made.largest_risk),
                str(found.wrong),
            )
        )
    said = Text(rule_in_words(settings.decision))
    if not rows:
        nothing = "No decision is possible: nothing about the tool point is believed."
        return Section("decisions", "Does the tool point conform?", (said, Text(nothing)))
    poses = counted(len(campaign.setting.test_q), "held-out pose")
    table = Table(
        caption=f"Decisions at {poses}: the mean tool point within "
        f"{limit_words(settings.decision)} of the nominal one",
        head=heads(
            "trial, program, number pass, number without decision, number fail, "
            f"guard band {unit}, largest share of risk in a pass, wrong number"
        ),
        rows=tuple(rows),
        align="llrrrrrr",
        note="as it was: joints from the nominal model, which deviate as the identified one says. "
        "corrected: by the identified model, so that no deviation is predicted. guard band: median "
        "of R95 of the believed region. risk: of the consumer, specific (JCGM 106): probability "
        "that a pose that passes is out of tolerance. wrong: what the truth says, known in a "
        "simulation only: passes out of tolerance, fails within.",
    )
    return Section("decisions", "Does the tool point conform?", (said, table))


def limit_words(by: Decision) -> str:
    """The tolerance with its unit."""
    return as_stated(by.tolerance).replace("um", "µm")


def rule_in_words(by: Decision) -> str:
    """The decision rule, as a certificate would state it."""
    limit = limit_words(by)
    if by.rule == "simple":
        return (
            f"Tolerance {limit} on the distance of the mean tool point from the nominal "
            "one, simple acceptance without a guard band, as the scenario asks: at the limit a "
            "pass has a risk of 50 % or more. Where the tolerance is smaller than R95 (95 %, 3-D) "
            "of the believed region, no pass is possible."
        )
    return (
        f"Tolerance {limit} on the distance of the mean tool point from the nominal one, "
        "decided with a guard band of R95 (95 %, 3-D) of the believed region on both sides of the "
        "limit: by that region a pass has a risk of at most 5 %, and between the bands no decision "
        "is possible."
    )


def decided_in_words(campaign: Campaign) -> str:
    """The decisions on the first trial in one sentence; empty without a tolerance."""
    if campaign.scenario.tolerance is None:
        return ""
    found = decide(campaign, campaign.trials[0].estimates[0])
    if not found:
        return " Whether the tool point conforms cannot be decided: nothing is believed."
    said = f"corrected, of the held-out poses: {found['after'].made.sentence}"
    return f" {typeset(sentence(said))}"


def published(campaign: Campaign, estimate: Estimate) -> list[Quantity]:
    """The decisions in result.json."""
    settings, out = campaign.scenario.tolerance, []
    for name, found in decide(campaign, estimate).items():
        made = found.made
        figures = [
            *(Quantity(word, made.counts.get(word, 0)) for word in ("pass", "undecided", "fail")),
            Quantity("wrong", found.wrong),
            Quantity("guard_median_um", float(np.median(made.guard)), METRE),
            Quantity("largest_risk_of_a_pass", made.largest_risk),
        ]
        out += below(f"decisions/{name}", figures)
    if out and settings is not None:
        out.insert(0, Quantity("decisions/rule", settings.decision.rule))
        out.insert(0, stated("decisions/tolerance_um", settings.decision.tolerance, METRE))
    return out
