"""Order of the columns in the systems of many robots, and which are sums of other columns."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, Index
from calib.geometry.chain import Chain
from calib.geometry.many import ManyStands
from calib.geometry.many_springs import ManyLoads
from calib.geometry.model import RobotModel
from calib.kernels.robots_plain import Made


@dataclass(frozen=True, slots=True, eq=False)
class ColumnPlaces:
    """Rows of J for the numbers of a model: hidden ones that others need, then the free ones."""

    hidden: int
    """Number of hidden rows, whose numbers are not free."""
    screws: Index
    """(S,) row of each screw, -1 for none."""
    terms: int
    """Number of joint terms; the numbers of the springs follow them among the joint errors."""
    errors: tuple[tuple[int, int, Index], ...]
    """For each free number of the joint errors its place among them, its row, and the rows of the
    screws it is a sum of: one for a term or a spring, those of all springs for a moment or tilt."""

    @classmethod
    def of(cls, model: RobotModel, free: Index) -> "ColumnPlaces":
        """Rows for the numbers at places `free` (f,) of the full vector, in their order."""
        own, joint_errors = _screws(model)
        of_chain = free < len(own)
        screws, errors = own[free[of_chain]], (free[~of_chain] - len(own)).tolist()
        needed = {screw for k in errors for screw in joint_errors[k].tolist()}
        hidden = sorted(needed - {*screws.tolist()})
        row, place = len(hidden) + np.arange(len(free)), np.full(own[-1] + 1, -1)
        place[hidden], place[screws] = range(len(hidden)), row[of_chain]
        made = zip(errors, row[~of_chain].tolist(), strict=True)
        return cls(
            len(hidden),
            place,
            len(model.joint_errors.terms),
            tuple((k, to, place[joint_errors[k]]) for k, to in made),
        )

    def made(self, stands: ManyStands) -> list[Made]:
        """Rows of the joint errors as sums of other rows, at some configurations."""
        found: list[Made] = []
        for k, to, rows in self.errors:
            if stands.loads is None or k < self.terms:
                factors = stands.values.terms[None, k]
            else:
                factors = stands.loads.slopes(k - self.terms)
            found.append((to, [*zip(rows.tolist(), factors, strict=True)]))
        return found

    def bend(self, loads: ManyLoads, J: Array, r: Array) -> Array | None:
        """Minus residuals r (6, R, m) times the second derivatives of the prediction (R, f, f).

        Only the largest ones, of springs with moments and tilts; None without any.
        """
        own = [(k - self.terms, to, rows) for k, to, rows in self.errors if k >= self.terms]
        if not own or own[-1][0] < loads.give.shape[1]:
            return None
        number, to = (np.array(part) for part in list(zip(*own, strict=True))[:2])
        pull = (J[:, own[-1][2]] * r.swapaxes(0, 1)[:, None]).sum(axis=2)
        free, f = to - self.hidden, J.shape[1] - self.hidden
        out = np.zeros((len(J), f, f))
        out[:, free[:, None], free] = -loads.curvature(pull)[:, number[:, None], number]
        return out


def _screws(model: RobotModel) -> tuple[Index, list[Index]]:
    """Screw of each number of the chain, and the screws that each joint error is a sum of."""
    chain, errors = model.chain, model.joint_errors
    if errors.springs is None:
        own = np.arange(chain.n_numbers)
        moves = 6 + 5 * np.arange(chain.n_joints) + (chain.prismatic != 0)
        return own, [moves[[joint]] for joint in errors.joints]
    own, bends = bent_screws(chain)
    terms = [bends[[joint], 2] for joint in errors.joints]
    sprung = bends.ravel()[errors.springs.places]
    weights = len(errors.springs.names) - len(sprung)
    return own, [*terms, *sprung[:, None], *[sprung] * weights]


def bent_screws(chain: Chain) -> tuple[Index, Index]:
    """Screws (12 + 5 n,) of the numbers of a chain on springs, and (n, 3) of its bends.

    They are counted among the two links, of five numbers each, that `ManyModels.bent` makes of
    each joint.
    """
    n = chain.n_joints
    first = 6 + 10 * np.arange(n)
    links = first[:, None] + [0, 6, 7, 8, 9]
    own = np.concatenate([np.arange(6), links.ravel(), np.arange(6) + 6 + 10 * n])
    along = first + (chain.prismatic != 0)
    return own, np.stack([first + 3, first + 4, along], axis=1)
