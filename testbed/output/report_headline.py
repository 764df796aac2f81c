"""The first screen of the report: the table of held-out errors and the next step."""

import numpy as np

from calib.identification.identify import Identification, Status
from calib.information.propagation import point_uncertainty
from calib.measurement.accuracy import Accuracy
from calib.uncertainty.regions import coverage_factor
from testbed.output.quantities import (
    MM,
    counted,
    fixed,
    millimetres,
    percent,
    probability,
    significant,
)
from testbed.output.report_parts import Table
from testbed.output.verdict import ALARM, Verdict, judge
from testbed.records import Campaign, Trial

NONE = "–"
SHORT = {"whitened": "default", "paper": "paper"}
"""Estimators in the columns of tables."""


def headline_table(campaign: Campaign) -> Table:
    """One row per trial and estimator: errors on held-out poses and what was stated of them."""
    first = campaign.trials[0].estimates[0].comparison
    rows = [("nominal model", "", "", *_statistics(first.accuracy_before), *[NONE] * 8)]
    for trial in campaign.trials:
        for k, estimate in enumerate(trial.estimates):
            found, seen = estimate.identification, estimate.comparison
            u = np.sqrt(np.mean(point_uncertainty(seen.covariance) ** 2))
            rows.append(
                (
                    trial.name if k == 0 else "",
                    set_in_words(trial) if k == 0 else "",
                    SHORT[estimate.mode],
                    *_statistics(seen.accuracy_after),
                    millimetres(u, 2),
                    percent(float(seen.inside.mean())),
                    significant(found.chi_square / found.dof, 3) if tested(found) else NONE,
                    probability(found.p_value) if tested(found) else NONE,
                    significant(found.reduction.condition, 3),
                    str(found.rank),
                    significant(seen.nees, 3),
                    in_a_word(judge(trial, estimate)),
                )
            )
    return Table(
        caption=f"Tool position error on {counted(len(first.before), 'held-out pose')} against the "
        "noise-free truth, and what was stated",
        head=(
            "trial",
            "pose set",
            "estimator",
            "mean mm",
            "rms mm",
            "p95 mm",
            "max mm",
            "stated u mm",
            "inside 95 %",
            "χ²/dof",
            "p",
            "cond.",
            "rank",
            "NEES",
            "believe",
        ),
        rows=tuple(rows),
        align="lllrrrrrrrrrrrl",
        strong=(1,),
        size="small",
        note="mean, rms, p95, max: distance between true and predicted tool point. stated u: root "
        "mean square over the held-out poses of the 3-D standard uncertainty (k = 1). inside 95 %: "
        "share of held-out poses whose true tool point lies in the stated 95 % ellipsoid. χ²/dof "
        "and p: residuals against the stated noise (p < 0.001 is an alarm). cond.: of the scaled "
        "Jacobian of the kept parameters, each estimator in its own rows. rank: parameters "
        "estimated. NEES: squared parameter error in units of the stated covariance; expected "
        "value = rank. default: whitened "
        "rows, all free parameters that can be told apart. paper: 24 parameters with base and "
        "tool taken as known, twelve unweighted rows.",
    )


def tested(found: Identification) -> bool:
    """Whether the residuals can be tested: the noise is known, and equations are left over."""
    return found.mode == "whitened" and found.dof > 0


def _statistics(error: Accuracy) -> tuple[str, ...]:
    """Mean, rms, p95 and maximum in mm."""
    values = (error.mean, error.rms, error.p95, error.maximum)
    return tuple(fixed(value * MM, 4) for value in values)


def set_in_words(trial: Trial) -> str:
    """How many poses and how they were chosen."""
    number = counted(len(trial.selection.indices), "pose")
    method = trial.method.replace("_", " ")
    return f"{number}, {method if method == 'random' else f'{method} {trial.selection.criterion}'}"


def next_step(campaign: Campaign) -> str:
    """What a person should do after reading the verdict on the first estimate."""
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    found, seen = estimate.identification, estimate.comparison
    errors = (
        f"held-out errors (95 % of poses below {millimetres(seen.accuracy_after.p95, 2)} mm, "
        f"maximum {millimetres(seen.accuracy_after.maximum, 2)} mm)"
    )
    if found.status is not Status.CONVERGED:
        return f"The fit did not end in a minimum. {found.status.value}"
    if tested(found) and found.p_value < ALARM:
        factor = np.sqrt(found.chi_square / found.dof)
        return (
            f"The residuals are {significant(float(factor), 2)} times what the noise explains, so "
            "the model lacks something that the robot has (sagging or wobbling joints, frames held "
            "fixed that moved, parameters not freed). Until the model is extended quote the "
            f"{errors} instead of the stated uncertainty. More poses do not help: they shrink the "
            "stated uncertainty, not the error."
        )
    if judge(trial, estimate).contradicted:
        return f"Do not quote the stated uncertainty; quote the {errors}."
    u = float(np.sqrt(np.mean(point_uncertainty(seen.covariance) ** 2)))
    return (
        f"The stated uncertainty may be used: the tool point of poses like the held-out ones with "
        f"rms u = {millimetres(u, 2)} mm (3-D, k = 1) and the 95 % ellipsoid of each pose "
        f"(k = {coverage_factor(3):.2f} along its axes). Four times the poses would halve u."
    )


def in_a_word(verdict: Verdict) -> str:
    """Whether to believe, for a table."""
    return "yes" if verdict.believable else "NO" if verdict.contradicted else "?"
