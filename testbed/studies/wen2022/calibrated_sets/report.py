"""The report's section on random sets that were calibrated, with the designed ones among them."""

from testbed.report.page import Block, Figure, Points, Section, Table, Text, heads
from testbed.studies.trial.plots import only
from testbed.studies.trial.records import Campaign
from testbed.studies.wen2022.calibrated_sets import plots
from testbed.studies.wen2022.calibrated_sets.records import random_calibrations_of
from testbed.studies.wen2022.calibrated_sets.summary import Rank, ranks
from testbed.studies.wen2022.records import ESTIMATORS
from testbed.studies.wen2022.tables import ESTIMATOR_NAMES
from testbed.units import MM, counted, fixed, significant

UNRELATED = "which is no sign of any relation"


def sets_section(campaign: Campaign) -> Section | None:
    """Index and error of designed sets beside those of random sets of their size."""
    study = random_calibrations_of(campaign)
    if study is None:
        return None
    found = ranks(campaign)
    blocks: list[Block] = [
        Text(procedure(found)),
        Points(tuple(standing(rank) for rank in found if rank.estimator == ESTIMATORS[0])),
        Figure(
            "Error after calibration with the paper's estimator against the index by which sets "
            "are chosen: at the held-out points (top) and on the set's own poses. The line is the "
            f"designed set's error{only(study.sets, plots.MOST_SETS)}.",
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
"""Sets without an estimate that the report lists."""


def procedure(found: tuple[Rank, ...]) -> str:
    """How the figures were made."""
    return (
        f"Each of {found[0].sets} random sets of a designed set's size was measured once on this "
        "robot and calibrated, as the designed set was, and judged against the truth at the same "
        "held-out points: a designed set and one random set say little of each other."
    )


def standing(rank: Rank) -> str:
    """Where one designed set stands, in words."""
    ahead = (rank.designed_index - rank.random_index.mean) / (rank.random_index.sd or 1.0)
    low, high = rank.correlation_ends
    between = f"{fixed(low, 2)} to {fixed(high, 2)}"
    related = f" ({between}), {UNRELATED}" if low <= 0 <= high else f" ({between})"
    below = rank.own_lower_than
    own = f"less than {below} of them" if below else "more than all of them"
    return (
        f"{rank.trial} ({counted(rank.poses, 'pose')}) has {rank.index} = "
        f"{significant(rank.designed_index, 3)}, {fixed(ahead, 1)} standard deviations above the "
        f"mean of random sets. At the held-out points it leaves {fixed(rank.designed * MM, 3)} mm, "
        f"random sets {rank.random.millimetres} mm: it is better than {rank.better_than} of "
        f"{rank.sets}. On its own poses it leaves {own}. "
        f"Among random sets {rank.index} and the held-out error have a rank correlation of "
        f"{fixed(rank.correlation, 2)}{related}."
    )


def rank_table(found: tuple[Rank, ...]) -> Table:
    """Every designed set by every estimator, beside the mean and spread of random sets."""
    rows = [
        (
            rank.trial if rank.estimator == ESTIMATORS[0] else "",
            ESTIMATOR_NAMES[rank.estimator],
            f"{fixed(rank.own_before * MM, 3)} to {fixed(rank.own_after * MM, 3)}",
            f"{fixed(rank.random_own_before.mean * MM, 3)} to {rank.random_own_after.millimetres}",
            fixed(rank.designed * MM, 3),
            rank.random.millimetres,
            f"{fixed(rank.smallest * MM, 3)} to {fixed(rank.largest * MM, 3)}",
            f"{rank.better_than} of {rank.sets}",
        )
        for rank in found
    ]
    return Table(
        caption="Each designed set among random sets of its size, all calibrated; errors in mm",
        head=heads(
            "set, estimator, own poses: designed, random, held out: designed, random, best to "
            "worst, better than"
        ),
        rows=tuple(rows),
        align="llrrrrrr",
        size="small",
        note="± is the standard deviation between random sets, not an uncertainty of their mean. "
        "own poses: mean distance to what was measured, before to after. held out: mean error "
        "against the noise-free truth. better than: random sets with a larger held-out error.",
    )
