"""Tables of the coverage study: attained shares with bands, parameters, and the advice."""

import numpy as np

from testbed.report.page import Table
from testbed.studies.coverage.records import MODELS, STATEMENTS, CoverageStudy
from testbed.studies.coverage.summary import Cell, NumbersCheck, cells, followed
from testbed.studies.many_robots import mean_over_robots
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

SHORT = {"model": "model-based", "discrepancy": "with discrepancy", "conformal": "conformal"}
WORDS = {"holds": "kept", "wide": "wide", "short": "NO"}


def summary_table(studies: tuple[CoverageStudy, ...]) -> Table:
    """The first screen: one row per kind of robot, a column per model and statement."""
    found = cells(studies)
    rows = [
        (
            study.truth,
            *(
                share_of(cell.share.value) + ("" if cell.believable else " NO")
                for cell in found
                if cell.truth == study.truth
            ),
        )
        for study in studies
    ]
    return Table(
        caption=f"Share of true tool points inside {percent(studies[0].level)} statements, over "
        f"{counted(studies[0].before.size, 'robot')} of each kind",
        head=(
            "truth",
            *(f"{model}: {SHORT[statement]}" for model in MODELS for statement in STATEMENTS),
        ),
        rows=tuple(rows),
        align="l" + "r" * (len(MODELS) * len(STATEMENTS)),
        note="NO: falls short by bands over robots that hold for all cells at once.",
    )


def coverage_table(studies: tuple[CoverageStudy, ...], found: tuple[Cell, ...]) -> Table:
    """Truth x model x statement: share inside with its band, radius, and the word."""
    by_name = {study.truth: study for study in studies}
    rows, strong = [], []
    for k in range(0, len(found), len(STATEMENTS)):
        three = found[k : k + len(STATEMENTS)]
        first = three[0]
        study, i = by_name[first.truth], MODELS.index(first.model)
        cells_of = [
            part
            for cell in three
            for part in (
                attained_share(cell.share),
                micrometres(cell.radius, 3),
                WORDS[cell.outcome],
            )
        ]
        rows.append(
            (
                first.truth if i == 0 else "",
                first.model,
                micrometres(float(study.mean_error[i].mean()), 3),
                *cells_of,
                percent(float(study.flagged[i].mean())),
            )
        )
        if i == int(study.extended.mean() > 0.5):
            strong.append(len(rows) - 1)
    head = [
        part
        for statement in STATEMENTS
        for part in (f"{SHORT[statement]}: inside", "radius µm", "promise")
    ]
    return Table(
        caption=f"Attained coverage of {percent(studies[0].level)} statements over "
        f"{counted(studies[0].before.size, 'robot')} of each kind",
        head=("truth", "model", "error µm", *head, "flagged"),
        rows=tuple(rows),
        align="llr" + "rrl" * len(STATEMENTS) + "r",
        size="small",
        strong=tuple(strong),
        note="inside: share of held-out points inside what is stated, mean over robots and 95 % "
        "band; ± 0.0 is a band below 0.05 %. radius: of the ball with "
        "the region's volume. error: mean distance of true and predicted point. promise: kept, NO "
        "where the band that holds for all cells at once lies below it, wide where it lies "
        "above. flagged: robots on which the program says that the model-based region is not "
        "valid. Bold: the model that the evidence chooses on most of these robots.",
    )


def numbers_table(checks: list[NumbersCheck], study: CoverageStudy) -> Table:
    """Coverage of the parameters, NEES and ranks."""
    return Table(
        caption="The numbers of the geometric model against the truth",
        head=(
            "truth",
            "numbers",
            f"inside {percent(study.level)}: mean",
            "least",
            "most",
            "band of all",
            "NEES",
            "band",
            "NEES p",
            "ranks p",
        ),
        rows=tuple(
            (
                check.truth,
                str(len(check.names)),
                share_of(float(check.shares.mean())),
                share_of(float(check.shares.min())),
                share_of(float(check.shares.max())),
                f"{share_of(check.band[0])} to {share_of(check.band[1])}",
                significant(check.nees, 4),
                f"{check.nees_band[0]:.2f} to {check.nees_band[1]:.2f}",
                probability(check.nees_p),
                probability(check.rank_p),
            )
            for check in checks
        ),
        align="lrrrrrrrrr",
        note="band of all: holds the shares of all numbers at once in 99.9 % of honest studies. "
        "NEES: mean squared joint error in units of the stated covariance, expected the count of "
        "numbers, with its 99.9 % band; NEES p: its whole distribution against chi-square. ranks "
        "p: place of the true value in the stated distribution against an even spread, smallest "
        "over the numbers times their count (Kolmogorov-Smirnov).",
    )


def advice_table(studies: tuple[CoverageStudy, ...]) -> Table:
    """What the program chooses and believes, and what comes of it."""
    rows = []
    for study in studies:
        robots = np.arange(study.before.size)
        told = study.believed[study.extended.astype(int), robots]
        shares, _ = followed(study)
        rows.append(
            (
                study.truth,
                fixed(float(study.before.mean()) * MM, 3),
                percent(float(study.extended.mean())),
                *(percent(float((told == j).mean())) for j in range(len(STATEMENTS))),
                attained_share(mean_over_robots(shares)) if len(shares) > 1 else "–",
            )
        )
    return Table(
        caption="What the program advises, and what comes of it",
        head=(
            "truth",
            "before mm",
            "extended chosen",
            *(f"believe {SHORT[statement]}" for statement in STATEMENTS),
            "inside, advice followed",
        ),
        rows=tuple(rows),
        align="l" + "r" * (len(STATEMENTS) + 3),
        note="before: mean held-out error of the nominal model. believe: share of the robots on "
        "which the program says to believe this statement of the chosen model. advice followed: "
        "share inside that statement.",
    )


def attained_share(mean: Mean) -> str:
    """A share with its band, in percent."""
    return f"{fixed(100 * mean.value, 1)} ± {fixed(100 * mean.half_width, 1)}{NARROW}%"


def share_of(value: float) -> str:
    """A share in percent with one decimal; all or nothing only where it is just that."""
    if value in (0.0, 1.0):
        return f"{100 * value:.0f}{NARROW}%"
    if value >= 0.9995:
        return f"> 99.9{NARROW}%"
    return f"{fixed(100 * value, 1)}{NARROW}%"
