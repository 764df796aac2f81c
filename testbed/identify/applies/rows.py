"""Where held-out poses lie against what they prove together, each with its own radius."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index, Labels
from calib.uncertainty.statement.applicability import BEYOND, BEYOND_SLIDE
from calib.uncertainty.statement.distance import distance_radius, radius_over
from calib.uncertainty.statement.places import PLACES, place_words, reasons
from calib.uncertainty.statement.stated_point import widened
from testbed.identify.calibration import Calibration
from testbed.lengths import with_unit
from testbed.store.quantities import Quantity
from testbed.units import DEG, MM, UM, listed, percent

HEAD = ("place", "transfer", "leverage", "R95_mean_um", "R95_relative", "why")
ELSEWHERE = 0.25
"""Share of the held-out poses from which a joint beyond its range in training is told: of few drawn
at random some are."""
WIDER = 1.5
"""So many times as wide must R95 be by poses at the edge, to say so."""
MOST_NAMED = 5
"""Of these poses, named."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldOutPlaces:
    """Held-out rows against what was proven."""

    rows: Index
    """(n,) of the table."""
    place: Labels
    """(n,) inside, edge or outside."""
    transfer: Array
    leverage: Array
    radius: Array
    """(n,) R95 of the mean, grown at the edge; zero where no region is stated [m]."""
    why: tuple[str, ...]
    relative: bool
    """Whether these radii are of tool points to each other."""

    def cells(self) -> dict[int, tuple[str, ...]]:
        """Row of the table to its cells of `HEAD`."""
        out, told = dict[int, tuple[str, ...]](), "yes" if self.relative else "no"
        for k, row in enumerate(map(int, self.rows)):
            radius = f"{self.radius[k] * UM:.4g}" if self.radius[k] > 0 else ""
            out[row] = (
                str(self.place[k]), f"{self.transfer[k]:.3g}", f"{self.leverage[k]:.3g}", radius,
                told if radius else "", self.why[k],
            )  # fmt: skip
        return out


def held_out_places(calibration: Calibration) -> HeldOutPlaces | None:
    """Where every held-out row lies; None where nothing is believed, or none is held out.

    Against all of them; against the poses identified from where these prove nothing.
    """
    belief, rows = calibration.proof.belief, np.flatnonzero(calibration.split.is_test)
    if belief is None or not len(rows):
        return None
    table = calibration.measurements.rows(rows)
    reach, regions = belief.proven.applies(table.q), belief.seen_regions(table)
    stated = reach.place != "outside"
    return HeldOutPlaces(
        rows, reach.place, reach.transfer, reach.leverage,
        np.where(stated, distance_radius(widened(regions), belief.probability), 0.0),
        reasons(belief.proven, reach, table.q), calibration.relative,
    )  # fmt: skip


def held_out_words(calibration: Calibration) -> tuple[str, ...]:
    """Where held-out poses lie against each other, and against the poses identified from."""
    found = held_out_places(calibration)
    said = list(beyond_training(calibration))
    if found is not None:
        table = calibration.measurements
        first = np.unique(table.pose_id[found.rows], return_index=True)[1]
        names = [calibration.pose_names[int(table.pose_id[row])] for row in found.rows[first]]
        against = " by the poses identified from" if calibration.elsewhere else ""
        said.append(
            place_words(found.place[first], "held-out pose", "held-out poses", names) + against
        )
    return tuple(said)


def edge_words(calibration: Calibration) -> tuple[str, ...]:
    """Which few held-out poses make R95 as wide as it is: those at the edge of what all prove."""
    found, table = held_out_places(calibration), calibration.measurements
    point, belief = calibration.proof.point, calibration.proof.belief
    if found is None or point is None or belief is None or calibration.elsewhere:
        return ()
    edge = found.place != "inside"
    if table.is_distance[found.rows].any() or not edge.any() or edge.all():
        return ()
    own = widened(belief.seen_regions(table.rows(found.rows)))
    wide, usual = (
        radius_over(each, np.full(len(each), 1 / len(each)), belief.probability)
        for each in (own, own[~edge])
    )
    if wide < WIDER * usual:
        return ()
    poses = np.unique(table.pose_id[found.rows])
    far = [calibration.pose_names[k] for k in np.unique(table.pose_id[found.rows[edge]]).tolist()]
    narrow = with_unit(point.radius_mean * usual / wide)
    return (
        f"R95 is so wide because of {len(far)} of the {len(poses)} held-out poses, at the edge of "
        f"what they prove ({listed(far, MOST_NAMED)}): at poses like the others it is "
        f"{narrow}; training poses like these would narrow it",
    )


def beyond_training(calibration: Calibration) -> tuple[str, ...]:
    """Whether the proof stands where nothing was identified from."""
    table, is_test = calibration.measurements, calibration.split.is_test
    if not is_test.any():
        return ()
    train, test = table.q[calibration.is_used], table.q[is_test]
    kinds, far = calibration.nominal.chain.kinds, []
    for j, kind in enumerate(kinds):
        room, scale, unit = (BEYOND, DEG, "deg") if kind == "revolute" else (BEYOND_SLIDE, MM, "mm")
        for side, end, share in (
            ("below", train[:, j].min(), (test[:, j] < train[:, j].min() - room).mean()),
            ("above", train[:, j].max(), (test[:, j] > train[:, j].max() + room).mean()),
        ):
            if share >= ELSEWHERE:
                where = f"{side} {end * scale:.0f} {unit}"
                far.append(f"joint {j + 1} {where} at {percent(float(share))}")
    if not far:
        return ()
    return (
        f"the held-out poses go beyond the training poses ({listed(far)}): all statements are "
        "about the region of the held-out ones",
    )


def place_numbers(calibration: Calibration) -> Iterator[Quantity]:
    """The same for result.json."""
    found = held_out_places(calibration)
    yield Quantity("sentences", held_out_words(calibration))
    if found is not None:
        for word in PLACES:
            yield Quantity(f"share_{word}", float((found.place == word).mean()))
