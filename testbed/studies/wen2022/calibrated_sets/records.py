"""Records of calibrated pose sets: designed ones, and random ones of their size."""

from dataclasses import dataclass
from typing import Annotated

from calib.arrays import Array, Index
from calib.information.observability import IndexName
from testbed.studies.trial.records import Campaign

RANDOM_CALIBRATIONS = "random_calibrations"
"""Key of the record on the one robot of the campaign."""
INDICES: tuple[IndexName, ...] = ("O1", "O2")
"""Indices by which the paper fixes the size of its sets, in its own rows."""


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedSets:
    """K pose sets of one size, each measured once and calibrated by both `records.ESTIMATORS`."""

    indices: Annotated[Index, "K", "m"]
    """(K, m) places in the pool."""
    index: Annotated[Array, 2, "K"]
    """(2, K) observability of each set by `INDICES`."""
    own_before: Annotated[Array, "K"]
    """(K,) mean distance to the readings at the set's own poses, nominal model [m]."""
    own_after: Annotated[Array, 2, "K"]
    """(2, K) the same for the identified model [m]."""
    error: Annotated[Array, 2, "K"]
    """(2, K) mean held-out error against the truth [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class AgainstRandom:
    """The set of one designed trial, and random sets of its size, all calibrated."""

    trial: str
    poses: int
    criterion: str
    designed: CalibratedSets
    """The designed set, as its trial measured it."""
    random: CalibratedSets
    """Random sets with an estimate by both estimators."""
    failed: tuple[str, ...]
    """Random sets without an estimate, and the reasons."""


@dataclass(frozen=True, slots=True, eq=False)
class RandomCalibrations:
    """Every designed trial's set among random sets of its size, on the robot of the campaign."""

    before: float
    """Mean held-out error of the nominal model [m]."""
    sets: tuple[AgainstRandom, ...]
    """One per designed trial, in the order of the scenario."""


def random_calibrations_of(campaign: Campaign) -> RandomCalibrations | None:
    """Designed sets among random ones, all calibrated; None if not played."""
    return campaign.records.find(RANDOM_CALIBRATIONS, RandomCalibrations)
