"""What a person should do after reading the verdict, and what may be quoted."""

import numpy as np

from calib.held_out_counts import fewest_poses
from calib.identification.identify import Status
from testbed.lengths import with_unit
from testbed.studies.trial.records import Campaign, Comparison
from testbed.studies.trial.statement.records import LEVEL, Statement
from testbed.studies.trial.verdict import ALARM, judge, strays_of, tested
from testbed.units import counted, millimetres, significant

NOISE = ("tracker noise", "joint repeatability", "gross errors")
"""Sources that more poses average out."""


def next_step(campaign: Campaign) -> str:
    """What a person should do after reading the verdict on the first estimate."""
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    found, statement = estimate.identification, estimate.statement
    if found.status is not Status.CONVERGED:
        return f"The fit did not end in a minimum. {found.status.value}"
    errors = errors_in_words(estimate.comparison)
    quoted = errors if statement is None else quotable(statement, errors)
    if judge(trial, estimate).contradicted:
        believed = statement is not None and statement.point is not None
        return f"Do not quote the stated uncertainty; quote {errors if believed else quoted}."
    outliers = 0 if statement is None else len(statement.outlier_poses)
    if outliers and found.loss == "squared":
        return (
            f"{counted(outliers, 'observation')} of the calibration do not fit the "
            "others (named below). Measure them again, or play the scenario with [identification] "
            f'loss = "cauchy". Until then quote {quoted}.'
        )
    if (strays := strays_of(statement)) is not None:
        few = len(strays.poses)
        return (
            f"{counted(few, 'held-out pose')} {'stands' if few == 1 else 'stand'} out where all "
            "others agree (named below), and can make the radius many times as wide. Measure "
            f"{'it' if few == 1 else 'them'} again. Until then quote {quoted}."
        )
    if tested(found) and found.p_value < ALARM:
        factor = np.sqrt(found.chi_square / found.dof)
        wider = (
            'Set model = "choose" under [identification], so that the evidence decides about sag '
            "and harmonics, and free what may have moved"
            if statement is None or statement.model == "geometric"
            else "Sag and harmonics are in the model already; look for backlash, warming, and "
            "frames that were held fixed but moved"
        )
        return (
            f"The residuals are {significant(float(factor), 2)} times as large as the noise "
            "explains: the model lacks something that the robot has, and more poses do not help. "
            f"{wider}. Until then quote {quoted}."
        )
    return f"Quote {quoted}. {more_poses(statement)}"


def errors_in_words(seen: Comparison) -> str:
    """The errors at the held-out poses; no share of so few that it would say nothing."""
    count, largest = len(seen.after), f"{millimetres(seen.accuracy_after.maximum, 2)} mm"
    if count < fewest_poses(LEVEL):
        return f"only that the error at {counted(count, 'held-out pose')} reaches {largest}"
    return (
        f"the held-out errors (95 % of poses below {millimetres(seen.accuracy_after.p95, 2)} mm, "
        f"maximum {largest})"
    )


def more_poses(statement: Statement | None) -> str:
    """What four times the poses would make of u: they shrink noise, and hardly anything else."""
    if statement is None or statement.point is None:
        return "Four times as many poses would halve the noise part."
    noise = np.isin(statement.sources, NOISE)
    if [name for name in statement.sources if name not in NOISE] == ["prior"]:
        return "Only a fit without the prior can show how much more poses would help."
    part = float(np.sqrt((statement.source_u[noise] ** 2).sum()))
    u = statement.point.u_mean
    return (
        f"Four times as many poses would halve the noise part, {_length(part, u, digits=2)} of "
        f"u = {_length(u, part, digits=2)} (3-D, k = 1)."
    )


def _length(value: float, *beside: float, digits: int = 3) -> str:
    """A length [m] with its unit, micro as one letter."""
    return with_unit(value, *beside, digits=digits).replace("um", "µm")


def quotable(statement: Statement, errors: str) -> str:
    """What may be quoted; the secret errors come last."""
    point = statement.point
    if point is None:
        if statement.conformal is None:
            return errors
        radius = _length(statement.conformal.radius)
        return f"the conformal radius, {radius} for 95 % of poses like the held-out ones"
    mean, move = point.radius_mean, point.radius_move
    words = f"{_length(mean, move)} (3-D radius, 95 %) for the mean of many moves"
    if np.isfinite(move):
        words += f" and {_length(move, mean)} for the end of a single move"
    return f"{words}, at poses like the {'held-out ones' if point.held_out else 'measured ones'}"
