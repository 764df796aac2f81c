"""Results of the compensation study, for the report and for result.json."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from testbed.store.quantities import METRE, RADIAN, Quantity, below, in_si
from testbed.studies.compensation.study import VARIANTS, WORTH, CompensationStudy
from testbed.studies.over_robots import Outcome as Compared
from testbed.studies.over_robots import family_confidence, log_ratio_over_robots, outcome_of

VALUE, UNCERTAINTY, FLOOR = range(len(WORTH))
PUBLISHED = {"median": "value", "p05": "low", "p95": "high", "u": "uncertainty", "floor": "floor"}
"""Names of the fields of `Typical` in result.json."""


@dataclass(frozen=True, slots=True)
class Typical:
    """One figure of a typical robot: median over robots of the mean over its poses [m or rad]."""

    value: float
    low: float
    """5th percentile over robots."""
    high: float
    """95th percentile over robots."""
    uncertainty: float
    """Standard uncertainty of the figure of one robot, root mean square over robots."""
    floor: float
    """Mean noise floor."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Results of one version of the program on robots of one kind."""

    truth: str
    variant: str
    ap: Typical
    rp: Typical
    angle: Typical
    ad: Typical
    rd: Typical
    true: float
    """AP without any noise [m]."""
    held_out: float
    """Mean held-out error of the correcting model, median over robots [m]."""
    held_out_p95: float
    """95th percentile of the held-out errors, median over robots [m]."""
    better: int
    """Robots on which the mean AP is smaller than before."""
    robots: int
    uncorrected: int
    """Number of targets of all robots that could not be corrected without reservation."""
    transfer: float
    """Largest transfer over the targets of all robots, of the chosen model."""
    leverage: float
    """Largest leverage, likewise."""
    edge: int
    """Number of targets at the edge of where a statement of the chosen model applies; regions are
    enlarged there."""
    outside: int
    """Number of targets outside, where it does not apply."""
    extended: float
    """Share of robots on which the evidence supports the extended model."""


def outcomes(study: CompensationStudy) -> tuple[Outcome, ...]:
    """Results before, corrected by the geometric model, and corrected by the chosen model."""
    figures = [*study.figures.swapaxes(0, 1), *study.distances.swapaxes(0, 1)[..., None]]
    before = mean_accuracy(study, 0)
    found = []
    for v, variant in enumerate(VARIANTS):
        ap, rp, angle, ad, rd = (_typical(figure[v]) for figure in figures)
        mean, p95 = np.median(study.held_out[v], axis=1)
        found.append(
            Outcome(
                truth=study.truth,
                variant=variant,
                ap=ap,
                rp=rp,
                angle=angle,
                ad=ad,
                rd=rd,
                true=float(np.median(study.true[v].mean(axis=1))),
                held_out=float(mean),
                held_out_p95=float(p95),
                better=int((mean_accuracy(study, v) < before).sum()),
                robots=len(before),
                uncorrected=int((~study.corrected[v]).sum()),
                transfer=float(study.reach[0].max()),
                leverage=float(study.reach[1].max()),
                edge=int((study.place == "edge").sum()),
                outside=int((study.place == "outside").sum()),
                extended=float(study.extended.mean()),
            )
        )
    return tuple(found)


def compared(studies: Sequence[CompensationStudy]) -> list[Compared]:
    """Whether AP of the program that the chosen model corrects is better than before, by kind.

    Robot by robot, by intervals that hold for all kinds at once.
    """
    together, chosen = family_confidence(len(studies)), VARIANTS.index("chosen")
    return [
        outcome_of(
            log_ratio_over_robots(
                mean_accuracy(study, chosen), mean_accuracy(study, 0), probability=together
            )
        )
        for study in studies
    ]


def mean_accuracy(study: CompensationStudy, variant: int) -> Array:
    """AP of each robot (R,), mean over the five poses [m]."""
    return np.asarray(study.figures[variant, 0, VALUE].mean(axis=1))


def _typical(figure: Array) -> Typical:
    """Typical robot of one figure (3, R, p): value, uncertainty and floor by robot and pose."""
    value = figure[VALUE].mean(axis=1)
    low, median, high = np.percentile(value, [5, 50, 95])
    # poses are read independently; common errors of the station are small in comparison
    u = np.sqrt((figure[UNCERTAINTY] ** 2).sum(axis=1)) / figure.shape[2]
    return Typical(
        float(median), float(low), float(high), float(np.sqrt((u**2).mean())),
        float(figure[FLOOR].mean()),
    )  # fmt: skip


def published(studies: tuple[CompensationStudy, ...]) -> list[Quantity]:
    """The study in result.json."""
    first = studies[0]
    out = [
        Quantity("robots", len(first.extended)),
        Quantity("trial", first.trial),
        Quantity("cycles", first.cycles),
    ]
    for study in studies:
        key = f"truths/{study.truth}"
        out.append(Quantity(f"{key}/extended_chosen", study.extended.mean()))
        for found in outcomes(study):
            out += below(f"{key}/{found.variant}", _of_variant(found))
    return out


def published_arrays(study: CompensationStudy) -> list[Quantity]:
    """Results of each robot, in arrays.npz."""
    figures = [*study.figures.swapaxes(0, 1), *study.distances.swapaxes(0, 1)]
    return in_si(
        {
            **dict(zip(("AP_m", "RP_m", "AP_angle_rad", "AD_m", "RD_m"), figures, strict=True)),
            "true_AP_m": study.true,
            "held_out_m": study.held_out,
            "targets": study.targets,
            "corrected": study.corrected,
        }
    )


def _of_variant(found: Outcome) -> Iterator[Quantity]:
    """Figures of one version of the program."""
    for name in ("AP", "RP", "AP_angle", "AD", "RD"):
        figure: Typical = getattr(found, name.removeprefix("AP_").lower())
        unit, ending = (RADIAN, "mdeg") if name == "AP_angle" else (METRE, "mm")
        for word, field in PUBLISHED.items():
            yield Quantity(f"{name}/{word}_{ending}", getattr(figure, field), unit)
    yield Quantity("true_AP_mm", found.true, METRE)
    yield Quantity("held_out_mean_mm", found.held_out, METRE)
    yield Quantity("held_out_p95_mm", found.held_out_p95, METRE)
    yield Quantity("robots_better", found.better)
    yield Quantity("targets_not_corrected", found.uncorrected)
    if found.variant == "chosen":
        yield Quantity("targets_at_the_edge", found.edge)
        yield Quantity("targets_outside", found.outside)
        yield Quantity("largest_transfer", found.transfer)
        yield Quantity("largest_leverage", found.leverage)
