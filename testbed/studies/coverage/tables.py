"""Tables of the coverage study: attained shares with bands, parameters, and the advice."""

import math
from itertools import chain, groupby

import numpy as np

from calib.uncertainty.drift.memory import REMEMBERS
from testbed.report.page import Table, table_of
from testbed.studies.coverage.study import MODELS, STATEMENTS, CoverageStudy
from testbed.studies.coverage.summary import Cell, NumbersCheck, advised, cells
from testbed.units import (
    MM,
    NARROW,
    Mean,
    counted,
    fixed,
    micrometres,
    percent,
    probability,
    significant,
)

SHORT = {
    "region": "believed",
    "model": "parameters alone",
    "discrepancy": "with discrepancy",
    "conformal": "conformal",
}
WORDS = {
    "holds": "kept",
    "wide": "wide",
    "short": "NO",
    "undecided": "undecided",
    "refused": "refused",
}
MARKS = {"holds": "", "wide": "", "short": " NO", "undecided": " ?", "refused": " refused"}


def summary_table(studies: tuple[CoverageStudy, ...]) -> Table:
    """The table of the first screen: a row per kind of robot, a column per model and statement."""
    return Table(
        caption=f"Share of true tool points inside {percent(studies[0].level)} statements, over "
        f"{counted(studies[0].before.size, 'robot')} of each kind",
        head=(
            "truth",
            *(f"{model}: {SHORT[statement]}" for model in MODELS for statement in STATEMENTS),
        ),
        rows=tuple(
            (truth, *(share_of(c.share.value) + MARKS[c.outcome] for c in of_kind))
            for truth, of_kind in groupby(cells(studies), key=lambda cell: cell.truth)
        ),
        note="NO: falls short by bands over robots that hold for all cells at once. ?: too few "
        "robots to tell. refused: the program states nothing there; the share is that of whoever "
        "would use it all the same.",
    )


def coverage_table(studies: tuple[CoverageStudy, ...], found: tuple[Cell, ...]) -> Table:
    """Share inside with its band, radius and outcome, by kind of robot, model and statement."""
    rows, strong = [], []
    for study in studies:
        for i, model in enumerate(MODELS):
            cells_of = [
                (attained_share(cell.share), micrometres(cell.radius, 3), WORDS[cell.outcome])
                for cell in found
                if (cell.truth, cell.model) == (study.truth, model)
            ]
            error = micrometres(float(study.mean_error[i].mean()), 3)
            flagged = percent(float(study.flagged[i].mean()))
            truth = study.truth if i == 0 else ""
            rows.append((truth, model, error, *chain.from_iterable(cells_of), flagged))
            if i == int(study.extended.mean() > 0.5):
                strong.append(len(rows) - 1)
    head = [(f"{SHORT[statement]}: inside", "radius µm", "promise") for statement in STATEMENTS]
    return Table(
        caption=f"Attained coverage of {percent(studies[0].level)} statements over "
        f"{counted(studies[0].before.size, 'robot')} of each kind",
        head=("truth", "model", "error µm", *chain.from_iterable(head), "flagged"),
        rows=tuple(rows),
        align="llr" + "rrl" * len(STATEMENTS) + "r",
        size="small",
        strong=tuple(strong),
        note="inside: share of held-out points inside what is stated, mean over robots and 95 % "
        "band. radius: of the ball with the region's volume. error: mean distance of true and "
        "predicted point. promise: kept, NO where the band that holds for all cells at once lies "
        "below it, wide where it lies above, undecided where it also holds a share that leaves "
        "twice as many points outside as promised, refused where the program states nothing. "
        "flagged: robots on which a test contradicts the region from the parameters alone. Bold: "
        "the model "
        "that the evidence chooses on most of these robots.",
    )


def numbers_table(checks: list[NumbersCheck], study: CoverageStudy) -> Table:
    """Coverage of the parameters, NEES and ranks."""
    rows = [
        {
            "truth": check.truth,
            "numbers": str(len(check.names)),
            f"inside {percent(study.level)}: mean": share_of(float(check.shares.mean())),
            "least": share_of(float(check.shares.min())),
            "most": share_of(float(check.shares.max())),
            "band of all": f"{share_of(check.band[0])} to {share_of(check.band[1])}",
            "NEES": significant(check.nees, 4),
            "band": f"{check.nees_band[0]:.2f} to {check.nees_band[1]:.2f}",
            "NEES p": probability(check.nees_p),
            "ranks p": probability(check.rank_p),
        }
        for check in checks
    ]
    return table_of(
        rows,
        "The numbers of the geometric model against the truth",
        note="band of all: holds the shares of all numbers at once in 99.9 % of honest studies. "
        "NEES: mean squared joint error in units of the stated covariance, expected the count of "
        "numbers, with its 99.9 % band; NEES p: its whole distribution against chi-square. ranks "
        "p: place of the true value in the stated distribution against an even spread, smallest "
        "over the numbers times their count (Kolmogorov-Smirnov).",
    )


def advice_table(studies: tuple[CoverageStudy, ...]) -> Table:
    """The models that the program chooses, the statements it makes, and their coverage."""
    rows = []
    for study in studies:
        chosen, robots = study.extended.astype(int), np.arange(study.before.size)
        followed = advised(study)
        drift = study.p_drift[chosen, robots] < REMEMBERS
        rows.append(
            {
                "truth": study.truth,
                "before mm": fixed(float(study.before.mean()) * MM, 3),
                "extended chosen": percent(float(study.extended.mean())),
                "places refused": share_of(1 - float(study.believed[chosen, robots].mean())),
                "grown": f"× {fixed(float(study.growth[chosen, robots].mean()), 2)}",
                "drift seen": percent(float(drift.mean())),
                "inside, advice followed": "–" if followed is None else attained_share(followed),
            }
        )
    return table_of(
        rows,
        "What the program advises, and what comes of it",
        note="before: mean held-out error of the nominal model. refused: places without a region, "
        "of the chosen model. grown: mean factor of the variance of what hides, which is one at a "
        "usual place of the proof and nowhere less. drift seen: robots whose readings follow their "
        "neighbors in time. advice followed: share inside the believed region of the chosen model, "
        "where there is one.",
    )


def attained_share(mean: Mean) -> str:
    """A share with its band in percent, rounded to the first digit of the band."""
    half = 100 * mean.half_width
    places = min(max(1, -math.floor(math.log10(half))), 4) if half > 0 else 1
    return f"{fixed(100 * mean.value, places)} ± {fixed(half, places)}{NARROW}%"


def share_of(value: float) -> str:
    """A share in percent with one decimal; 0 and 100 only if exact."""
    if value in (0.0, 1.0):
        return f"{100 * value:.0f}{NARROW}%"
    if value >= 0.9995:
        return f"> 99.9{NARROW}%"
    return f"{fixed(100 * value, 1)}{NARROW}%"
