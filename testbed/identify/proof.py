"""The proof of a calibration on held-out rows, and what no single number says of it."""

import numpy as np

from calib.arrays import Array
from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.measurement.observations import Measurements
from calib.uncertainty.bootstrap import Bootstrap, bootstrap
from calib.uncertainty.conformal import conformal, fewest_poses
from calib.uncertainty.discrepancy import FEWEST, discrepancy
from calib.uncertainty.held_out import HeldOut, held_out
from calib.uncertainty.trust import trust
from testbed.identify.records import Fit, Misses, Proof
from testbed.streams import stream
from testbed.units import in_units, significant, unit_of

REPLICATES = 400
"""Virtual calibrations that check whether linear propagation holds; 4 % in each deviation."""
MOST_ROWS = 300
"""Larger tables are not replicated: their linear intervals are tight enough to be linear."""


def proof_of(
    found: Identification,
    train: Measurements,
    test: Measurements,
    misses: Misses,
    *,
    seed: int,
) -> Proof:
    """Judge one identification by held-out rows.

    Parameters
    ----------
    found : Identification
        The fit that is handed out.
    train, test : Measurements
        Rows identified from, and held out.
    misses : Misses
        Of the held-out rows.
    seed : int
        Of the virtual calibrations.
    """
    seen = None
    if len(test) and not test.is_distance.any():
        seen = held_out(found.model, found.full_covariance, one_per_pose(test), train.q)
    spread = discrepancy(seen) if seen is not None and len(seen) >= FEWEST else None
    # a distance shows an error along one line only: no radius around a point comes of it
    seen_rows = ~test.is_distance
    worst = worst_of_pose(test.rows(seen_rows), misses.position[seen_rows])
    radius = conformal(worst) if len(worst) >= fewest_poses() else None
    replicated = _replicated(found, train, seen, seed)
    return Proof(
        held_out=seen,
        discrepancy=spread,
        conformal=radius,
        bootstrap=replicated,
        trust=trust(
            found, held_out=seen, discrepancy=spread, conformal=radius, bootstrap=replicated
        ),
    )


def one_per_pose(test: Measurements) -> Measurements:
    """The first row of every held-out pose: its others repeat the same error of the model."""
    return test.rows(np.unique(test.pose_id, return_index=True)[1])


def worst_of_pose(test: Measurements, position: Array) -> Array:
    """Largest miss of each held-out pose (p,) from those of the rows (k,) [m].

    Poses are alike in kind; rows of one pose are not independent.
    """
    _, pose = np.unique(test.pose_id, return_inverse=True)
    worst = np.zeros(int(pose.max(initial=-1)) + 1)
    np.maximum.at(worst, pose.ravel(), position)
    return worst


def _replicated(
    found: Identification, train: Measurements, seen: HeldOut | None, seed: int
) -> Bootstrap | None:
    """Virtual calibrations of the result, where they can decide anything and are cheap."""
    contradicted = found.p_value < RED or (seen is not None and seen.p_value < RED)
    plain = found.prior is None and found.loss == "squared"
    lonely = found.model.fixtures.n_numbers or train.is_distance.any()
    if contradicted or not plain or lonely or len(train) > MOST_ROWS:
        return None
    if found.status is not Status.CONVERGED:
        return None
    return bootstrap(
        found.model, train, found.parameters, stream(seed, "bootstrap"), replicates=REPLICATES
    )


LEAST_TURN, LEAST_SLIDE = np.radians(10.0), 0.010
"""Range of a joint at the training poses below which it counts as not moved [rad, m]."""
ILL_CONDITIONED = 1e3
"""Condition of the kept columns above which poses are too much alike."""


def warnings_of(geometric: Fit, chosen: Fit, train: Measurements) -> tuple[str, ...]:
    """Sentences on the poses, by the geometric fit, and on the fit that was chosen."""
    found = chosen.identification
    said = [*_still(geometric, train), *_condition(geometric)]
    if found.status is not Status.CONVERGED:
        said.append(f"the fit {found.status.value}")
    if found.p_value > 1 - RED:
        said.append(
            "the residuals are smaller than the stated noise: the stated uncertainty is too large"
        )
    return tuple(said)


def _still(fit: Fit, train: Measurements) -> tuple[str, ...]:
    """Which joints were hardly moved: nothing was learnt of them, and nothing tests it."""
    kinds = np.array(fit.identification.model.chain.kinds)
    least = np.where(kinds == "revolute", LEAST_TURN, LEAST_SLIDE)
    still = np.flatnonzero(np.ptp(train.q, axis=0) < least) + 1
    if not len(still):
        return ()
    many = len(still) > 1
    return (
        f"joint{'s' * many} {', '.join(map(str, still))} moved by less than "
        f"{np.degrees(LEAST_TURN):.0f} deg or {1e3 * LEAST_SLIDE:.0f} mm: nothing here says how "
        f"well the result holds where {'they stand' if many else 'it stands'} otherwise",
    )


def _condition(fit: Fit) -> tuple[str, ...]:
    """Whether the poses are too much alike, and which number suffers most."""
    found = fit.identification
    if found.reduction.condition <= ILL_CONDITIONED:
        return ()
    lengths = found.parameters.is_length[found.parameters.free_index]
    u = found.standard_uncertainty
    worst = int(np.argmax(u / found.parameters.free_scale))
    value = float(in_units(u, lengths)[worst])
    return (
        f"the poses are much alike: condition {significant(found.reduction.condition, 2)}; least "
        f"known is {found.names[worst]}, U = {significant(2 * value, 2)} "
        f"{unit_of(bool(lengths[worst]))} from the stated noise; vary the wrist and the tool's "
        "orientation more",
    )
