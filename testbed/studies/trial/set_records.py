"""Records of many pose sets of one robot: numbers of poses, random sets beside the chosen ones."""

from dataclasses import dataclass
from typing import Annotated

from calib.arrays import LATER, Array, Index
from calib.shown import Shown


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseCountStudy(Shown):
    """Mean index of random sets against the number of poses, and where the rule stops."""

    counts: Annotated[Index, "k"]
    """(k,) poses per set."""
    names: Annotated[tuple[str, ...], "i"]
    """(i,) O1 ... O5."""
    mean: Annotated[Array, "i", "k"]
    """(i, k) mean index over the random sets, paper rows; O3, O4, O5 as printed."""
    mean_per_pose: Annotated[Array, "i", "k"]
    """(i, k) correct per-pose form."""
    spread: Annotated[Array, "i", "k"]
    """(i, k) standard deviation over the sets (printed form)."""
    chosen: tuple[int | None, ...]
    """Poses the rule chooses for O1 and for O2, in that order; None if it never settles."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RandomSets(Shown):
    """The figure of one trial's set beside those of random sets of the same size."""

    trial: str
    criterion: str
    unit: str
    """Of the figure: "1" for an index, "m" for an uncertainty."""
    larger_is_better: bool
    n_poses: int
    chosen_value: float
    values: Annotated[Array, "k"]
    """(k,) figure of each random set that determines all numbers."""
    undetermined: Annotated[int, LATER] = 0
    """Further random sets, which do not: no figure of theirs means anything."""

    @property
    def drawn(self) -> int:
        """All random sets."""
        return len(self.values) + self.undetermined

    @property
    def beaten(self) -> int:
        """Random sets that are worse."""
        sign = 1.0 if self.larger_is_better else -1.0
        return int((sign * self.values < sign * self.chosen_value).sum()) + self.undetermined

    @property
    def mean(self) -> float | None:
        """Mean figure of the random sets that determine all numbers; None where none does."""
        return float(self.values.mean()) if len(self.values) else None

    @property
    def best(self) -> float | None:
        """Figure of the best random set; None where none determines all numbers."""
        if not len(self.values):
            return None
        return float(self.values.max() if self.larger_is_better else self.values.min())


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RandomSetsStudy(Shown):
    """Every designed trial's set beside random sets."""

    sets: tuple[RandomSets, ...]
