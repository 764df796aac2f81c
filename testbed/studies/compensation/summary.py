"""What the compensation study found, for the report and for result.json."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.arrays import Array
from testbed.studies.compensation.records import (
    DISTANCES,
    FIGURES,
    VARIANTS,
    WORTH,
    CompensationStudy,
)
from testbed.units import MDEG, MM, Quantity, in_si

VALUE, UNCERTAINTY, FLOOR = range(len(WORTH))


@dataclass(frozen=True, slots=True)
class Typical:
    """One figure of a typical robot: median over robots of the mean over its poses [m or rad]."""

    value: float
    low: float
    """5th percentile over robots."""
    high: float
    """95th percentile over robots."""
    uncertainty: float
    """Standard uncertainty of one such figure of one robot: root mean square."""
    floor: float
    """Mean noise floor."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One way to run the program on robots of one kind."""

    truth: str
    variant: str
    ap: Typical
    rp: Typical
    angle: Typical
    ad: Typical
    rd: Typical
    true: float
    """What AP would read without any noise [m]."""
    held_out: float
    """Mean held-out error of the model that corrects, median over robots [m]."""
    held_out_p95: float
    """95th percentile of the held-out errors, median over robots [m]."""
    better: int
    """Robots on which the mean AP is smaller than before."""
    robots: int
    uncorrected: int
    """Targets, of all robots, that could not be corrected without reserve."""
    extended: float
    """Share of robots on which the evidence asks for the extended model."""


def outcomes(study: CompensationStudy) -> tuple[Outcome, ...]:
    """Before, corrected by the geometric model, corrected by the chosen model."""
    names = [*FIGURES, *DISTANCES]
    figures = [*study.figures.swapaxes(0, 1), *study.distances.swapaxes(0, 1)[..., None]]
    before = mean_accuracy(study, 0)
    found = []
    for v, variant in enumerate(VARIANTS):
        typical = {name: _typical(figure[v]) for name, figure in zip(names, figures, strict=True)}
        mean, p95 = np.median(study.held_out[v], axis=1)
        found.append(
            Outcome(
                truth=study.truth,
                variant=variant,
                ap=typical["AP"],
                rp=typical["RP"],
                angle=typical["AP angle"],
                ad=typical["AD"],
                rd=typical["RD"],
                true=float(np.median(study.true[v].mean(axis=1))),
                held_out=float(mean),
                held_out_p95=float(p95),
                better=int((mean_accuracy(study, v) < before).sum()),
                robots=len(before),
                uncorrected=int((~study.corrected[v]).sum()),
                extended=float(study.extended.mean()),
            )
        )
    return tuple(found)


def mean_accuracy(study: CompensationStudy, variant: int) -> Array:
    """AP of each robot (R,), mean over the five poses [m]."""
    return np.asarray(study.figures[variant, 0, VALUE].mean(axis=1))


def _typical(figure: Array) -> Typical:
    """Worth, robots and poses (3, R, p) of one figure into one line."""
    value = figure[VALUE].mean(axis=1)
    low, median, high = np.percentile(value, [5, 50, 95])
    # poses are read independently; what the station gets wrong is common and small beside it
    u = np.sqrt((figure[UNCERTAINTY] ** 2).sum(axis=1)) / figure.shape[2]
    return Typical(
        float(median), float(low), float(high), float(np.sqrt((u**2).mean())),
        float(figure[FLOOR].mean()),
    )  # fmt: skip


def compensation_headline(studies: tuple[CompensationStudy, ...]) -> dict[str, Any]:
    """ISO 9283 figures of every kind of robot before and after."""
    first = studies[0]
    return {
        "robots": len(first.extended),
        "trial": first.trial,
        "cycles": first.cycles,
        "truths": {
            study.truth: {
                "extended_chosen": float(study.extended.mean()),
                **{found.variant: _outcome(found) for found in outcomes(study)},
            }
            for study in studies
        },
    }


def compensation_arrays(
    studies: tuple[CompensationStudy, ...],
) -> dict[str, np.ndarray[Any, Any]]:
    """What each robot gave."""
    out: dict[str, np.ndarray[Any, Any]] = {}
    for study in studies:
        key = f"compensation/{study.truth}"
        for j, name in enumerate(("AP_m", "RP_m", "AP_angle_rad")):
            out[f"{key}/{name}"] = study.figures[:, j]
        for j, name in enumerate(("AD_m", "RD_m")):
            out[f"{key}/{name}"] = study.distances[:, j]
        out[f"{key}/true_AP_m"] = study.true
        out[f"{key}/held_out_m"] = study.held_out
        out[f"{key}/targets"] = study.targets
        out[f"{key}/corrected"] = study.corrected
    return out


def _outcome(found: Outcome) -> dict[str, Any]:
    """One way to run the program."""
    return {
        "AP": _figure_numbers(found.ap, MM, "mm"),
        "RP": _figure_numbers(found.rp, MM, "mm"),
        "AP_angle": _figure_numbers(found.angle, MDEG, "mdeg"),
        "AD": _figure_numbers(found.ad, MM, "mm"),
        "RD": _figure_numbers(found.rd, MM, "mm"),
        "true_AP_mm": found.true * MM,
        "held_out_mean_mm": found.held_out * MM,
        "held_out_p95_mm": found.held_out_p95 * MM,
        "robots_better": found.better,
        "targets_not_corrected": found.uncorrected,
    }


def _figure_numbers(found: Typical, factor: float, unit: str) -> dict[str, float]:
    """One figure."""
    return {
        f"median_{unit}": found.value * factor,
        f"p05_{unit}": found.low * factor,
        f"p95_{unit}": found.high * factor,
        f"u_{unit}": found.uncertainty * factor,
        f"floor_{unit}": found.floor * factor,
    }


def published(studies: tuple[CompensationStudy, ...]) -> list[Quantity]:
    """The study in result.json; nothing where it is off."""
    return [Quantity("compensation", compensation_headline(studies))] if studies else []


def published_arrays(studies: tuple[CompensationStudy, ...]) -> list[Quantity]:
    """The study in arrays.npz."""
    return in_si(compensation_arrays(studies))
