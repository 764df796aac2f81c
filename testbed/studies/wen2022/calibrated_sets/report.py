"""The report's section on random sets that were calibrated, with the designed ones among them."""

from testbed.report.page import Block, Figure, Points, Section, Table, Text, heads
from testbed.studies.trial.plots import only
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022.calibrated_sets import plots
from testbed.studies.wen2022.calibrated_sets.records import random_calibrations_of
from testbed.studies.wen2022.calibrated_sets.summary import Rank, ranks
from testbed.studies.wen2022.records import ESTIMATORS
from testbed.studies.wen2022.tables import ESTIMATOR_NAMES
from testbed.units import MM, counted, fixed


def sets_section(campaign: Campaign) -> Section | None:
    """Index and error of designed sets beside those of random sets of their size."""
    study = random_calibrations_of(campaign)
    if study is None:
        return None
    found = ranks(campaign)
    blocks: list[Block] = [
        Figure(
            f"{found[0].sets} random sets of each designed set's size, measured and calibrated as "
            "it was, by the paper's estimator: error at held-out points (top) and on the set's own "
            "poses against the index by which sets are chosen; the line is the designed set's"
            f"{only(study.sets, plots.MOST_SETS)}.",
            plots.error_against_index(study.sets),
        ),
        rank_table(found),
    ]
    lost = [f"{one.trial}, {why}" for one in study.sets for why in one.failed]
    if lost:
        shown = f"; the first {MOST_LOST} of them" if len(lost) > MOST_LOST else ""
        blocks.append(
            Text(
                f"{counted(len(lost), 'random set')} gave no estimate and "
                f"{'is' if len(lost) == 1 else 'are'} left out{shown}:"
            )
        )
        blocks.append(Points(tuple(lost[:MOST_LOST])))
    return Section(
        "calibrated-sets",
        "Designed sets among random ones, all calibrated",
        tuple(blocks),
        part="detail",
    )


MOST_LOST = 10
"""Most sets without an estimate that the report lists."""


def related(rank: Rank) -> str:
    """Rank correlation of index and held-out error among random sets, with its interval."""
    low, high = rank.correlation_ends
    return f"{fixed(rank.correlation, 2)} ({fixed(low, 2)} to {fixed(high, 2)})"


def rank_table(found: tuple[Rank, ...]) -> Table:
    """Every designed set by every estimator, beside the mean and spread of random sets."""
    rows = [
        (
            rank.trial if rank.estimator == ESTIMATORS[0] else "",
            ESTIMATOR_NAMES[rank.estimator],
            fixed(rank.designed * MM, 3),
            rank.random.millimetres,
            f"{fixed(rank.smallest * MM, 3)} to {fixed(rank.largest * MM, 3)}",
            f"{rank.better_than} of {rank.sets}",
            related(rank),
        )
        for rank in found
    ]
    return Table(
        caption="Each designed set among random sets of its size, all calibrated; errors in mm",
        head=heads(
            "set, estimator, held out: designed, random, best to worst, better than, "
            "index and error"
        ),
        rows=tuple(rows),
        align="llrrrrr",
        size="small",
        note="± is the standard deviation between random sets. held out: mean error against the "
        "noise-free truth. better than: random sets with a larger one. index and error: their rank "
        "correlation among random sets, with its 95 % interval.",
    )
