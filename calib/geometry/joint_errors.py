"""Joint errors beyond the geometry: gravity sag, gear harmonics, backlash, and springs under load.

dq(q) = sum_k c_k b_k(q), where each b_k displaces one joint and is a sine or cosine of a
combination of joint values, or depends on the operating conditions of the row. An amplitude with a
phase is two terms: A sin(q + phi) = (A cos phi) sin q + (A sin phi) cos q. Springs bend a joint
about any axis. One kind of term displaces no joint: thermal expansion of the lengths.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Literal, get_args

import numpy as np

from calib.arrays import LATER, Array, check, frozen
from calib.errors import refuse
from calib.geometry.bodies import Z
from calib.geometry.chain import Chain
from calib.geometry.operating import AS_USUAL, OperatingConditions
from calib.geometry.springs import SprungJoints
from calib.kinds import of_kind

_WAVES: tuple[Literal["sin", "cos"], ...] = ("sin", "cos")
Wave = Literal["sin", "cos", "approach", "torque", "lengths"]
NO_JOINT = -1
"""`joint` of a term that displaces none."""


@dataclass(frozen=True, slots=True)
class JointTerm:
    """One basis function b and the joint that it displaces.

    b is a wave, sin(weights . q) or cos(weights . q), or is linear in the operating conditions of
    a row: weights . approach, or weights . torque - reference. For "lengths" b is temperature -
    reference, and its coefficient is the thermal expansion [1/K] of d and a of all links. A row
    that does not state the condition has b = 0.
    """

    name: str
    """Public name, e.g. ``gravity2.sin2`` or ``harmonic3.cos1``."""
    joint: int
    """Joint that is displaced, 0-based; -1 for lengths."""
    wave: Wave
    """Kind of basis function."""
    weights: tuple[float, ...]
    """(n,) factor of each joint value inside the wave, or of each direction or torque; zero for
    lengths."""
    reference: Annotated[float, LATER] = 0.0
    """Torque [N m] or temperature [degC] at which the term is zero: the mean of the rows that it
    was identified from."""
    share: Annotated[float, LATER] = 1.0
    """Prior sd of its coefficient, in units of the usual one of its kind (`information.sizes`); for
    a torque in 1/(N m)."""

    def __post_init__(self) -> None:
        if not isinstance(self.wave, str) or self.wave not in get_args(Wave):
            message = f"wave of the term {self.name} is {self.wave!r}"
            allowed = f"one of {', '.join(get_args(Wave))}"
            raise refuse("wave", self.wave, allowed, code="A3", message=message)
        (weights,) = check("n", weights=self.weights)
        whole = (int(w) if w.is_integer() else w for w in weights.tolist())
        object.__setattr__(self, "weights", tuple(whole))

    @property
    def order(self) -> float:
        """Periods per revolution of a wave of one joint: its largest absolute weight."""
        return max(abs(weight) for weight in self.weights)

    @property
    def is_wave(self) -> bool:
        """Whether b depends on the joint values alone."""
        return self.wave in _WAVES

    def of_rows(self, at: OperatingConditions, m: int) -> Array:
        """Values b (m,) of a term that is no wave, under the conditions of m rows."""
        if self.wave == "lengths":
            return np.zeros(m) if at.temperature is None else at.temperature - self.reference
        said = at.approach if self.wave == "approach" else at.torque
        if said is None:
            return np.zeros(m)
        return np.asarray(said @ np.array(self.weights, dtype=np.float64) - self.reference)


@dataclass(frozen=True, slots=True, eq=False)
class JointErrors:
    """A sum of joint terms with their coefficients, and springs; empty for a geometric robot."""

    terms: tuple[JointTerm, ...] = ()
    """(k,) basis functions."""
    coefficients: Array = ()  # type: ignore[assignment]  # becomes an array in __post_init__
    """(k + s,) one coefficient per term, then the numbers of the springs; all zero if left out
    [rad or m per unit of b, 1/K for lengths; rad, m, kg, kg m for springs]."""
    springs: Annotated[SprungJoints | None, LATER] = None
    """Springs that gravity bends; None for rigid joints."""

    def __post_init__(self) -> None:
        if type(self.terms) is not tuple or not all(type(term) is JointTerm for term in self.terms):
            terms = of_kind("terms", self.terms, Sequence[JointTerm])
            object.__setattr__(self, "terms", terms)
        (coefficients,) = check("k", coefficients=self.coefficients)
        count = len(self.terms) + (0 if self.springs is None else len(self.springs.names))
        if not len(coefficients):
            coefficients = frozen(np.zeros(count))
        if len(coefficients) != count:
            message = f"coefficients has {len(coefficients)} entries"
            wanted = f"one per term, {count}"
            raise refuse("coefficients", allowed=wanted, code="A1", message=message)
        object.__setattr__(self, "coefficients", coefficients)

    def require_chain(self, chain: Chain) -> None:
        """Raise an `InputError` (A1, A3) unless terms and springs belong to an arm like `chain`."""
        n = chain.n_joints
        for term in self.terms:
            own = (NO_JOINT,) if term.wave == "lengths" else range(n)
            if term.joint not in own:
                message = f"the term {term.name} ({term.wave}) is on joint {term.joint}"
                allowed = f"{NO_JOINT} of lengths, else 0 to {n - 1}"
                raise refuse("joint", term.joint, allowed, code="A3", message=message)
            if len(term.weights) != n:
                message = f"the term {term.name} has {len(term.weights)} weights"
                allowed = f"one for each of {n} joints"
                raise refuse("weights", len(term.weights), allowed, code="A1", message=message)
        if self.springs is not None and self.springs.weight.chain.kinds != chain.kinds:
            message = f"the springs weigh an arm of joints {self.springs.weight.chain.kinds}"
            raise refuse("springs", allowed=f"those of the chain, {chain.kinds}", code="A3",
                         message=message)  # fmt: skip

    @property
    def names(self) -> tuple[str, ...]:
        """(k + s,) names of the terms, then of the numbers of the springs."""
        sprung = () if self.springs is None else self.springs.names
        return (*(term.name for term in self.terms), *sprung)

    @property
    def joints(self) -> list[int]:
        """(k,) joint that each term displaces, 0-based; -1 where it displaces none."""
        return [term.joint for term in self.terms]

    @property
    def of_lengths(self) -> list[int]:
        """Indices of the terms for thermal expansion of the lengths."""
        return [k for k, term in enumerate(self.terms) if term.joint == NO_JOINT]

    def basis(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """Basis functions b_k (m, k) at joint values q (m, n) under the conditions of the rows.

        Dimensionless; in N m for torques, in K for lengths.
        """
        if not self.terms:
            return np.zeros((len(q), 0))
        phase = q @ np.array([term.weights for term in self.terms], dtype=np.float64).T
        cosine = np.array([term.wave == "cos" for term in self.terms])
        basis = np.empty_like(phase)
        basis[:, cosine], basis[:, ~cosine] = np.cos(phase[:, cosine]), np.sin(phase[:, ~cosine])
        for k, term in enumerate(self.terms):
            if not term.is_wave:
                basis[:, k] = term.of_rows(at, len(q))
        return basis

    def follow(self, at: OperatingConditions) -> bool:
        """Whether the errors depend on any of the conditions that are stated."""
        of_rows = {"lengths": "temperature"}
        asked = {of_rows.get(term.wave, term.wave) for term in self.terms if not term.is_wave}
        return bool({*asked, *(("payload",) if self.springs else ())} & {*at.stated})

    def growth(self, at: OperatingConditions) -> Array | None:
        """Relative thermal expansion (m,) of the lengths; None without a term or temperatures."""
        if at.temperature is None or not self.of_lengths:
            return None
        m = len(at.temperature)
        grown = [self.coefficients[k] * self.terms[k].of_rows(at, m) for k in self.of_lengths]
        return np.asarray(sum(grown))

    def offsets(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """Joint offsets dq (m, n) [rad or m] at joint values q (m, n), of joints without springs.

        Raises
        ------
        InputError
            A3: there are springs, which no joint offset describes.
        """
        if self.springs is not None:
            raise refuse(
                "springs", code="A3",
                message="these joint errors have springs, which bend a joint about three axes",
                allowed="here joint terms alone, which are offsets of joint values",
                fix="take the poses from the robot model, or leave the springs out",
            )  # fmt: skip
        return self.of_terms(q, at)

    def bends(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """Bends (m, n, 3) about x, y, z of every joint [rad or m]; the terms are part of z."""
        out = np.zeros((*q.shape, 3))
        if self.springs is not None:
            out = self.springs.bends(q, self.of_springs, at.moments)
        out[:, :, Z] += self.of_terms(q, at)
        return out

    def joined(self, other: "JointErrors") -> "JointErrors":
        """Sum of these and other joint errors; an `InputError` (A3) if both have springs."""
        if self.springs is not None and other.springs is not None:
            raise refuse(
                "springs", code="A3", message="both joint errors have springs",
                allowed="springs in one of them", fix="leave those of one out",
            )  # fmt: skip
        k, j = len(self.terms), len(other.terms)
        parts = (
            *(self.coefficients[:k], other.coefficients[:j]),
            *(self.coefficients[k:], other.coefficients[j:]),
        )
        springs = self.springs if other.springs is None else other.springs
        return JointErrors((*self.terms, *other.terms), np.concatenate(parts), springs)

    @property
    def of_springs(self) -> Array:
        """(s,) coefficients that are numbers of the springs."""
        return self.coefficients[len(self.terms) :]

    def of_terms(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """Joint offsets dq (m, n) [rad or m] by the terms alone."""
        return self.moved_by(self.basis(q, at), q.shape[1])

    def moved_by(self, basis: Array, n_joints: int) -> Array:
        """Joint offsets dq (m, n) [rad or m] by the terms, from their values (m, k) of `basis`."""
        each = (basis * self.coefficients[: len(self.terms)]).T
        dq, joints = np.zeros((len(basis), n_joints)), np.array(self.joints, dtype=np.int64)
        for joint in sorted({*self.joints} - {NO_JOINT}):
            dq[:, joint] = each[joints == joint].sum(axis=0)
        return dq


@cache
def gravity_terms(n_joints: int, quarters: tuple[int, int] = (0, 0)) -> tuple[JointTerm, ...]:
    """Gravity sag of an elbow arm: dq2 = g1 sin q2 + g2 sin(q2+q3), dq3 = g3 sin(q2+q3).

    Closed form for an arm whose joints 2 and 3 have parallel horizontal axes and whose zero pose
    points straight up; positive coefficients droop away from it. For another zero pose, `quarters`
    counts the quarter turns from upright of upper arm and forearm there, and an odd count turns
    sines into cosines: the UR10, horizontal at zero, has (1, 1).
    """
    if n_joints < 3:
        message = f"the closed gravity form needs three joints; the chain has {n_joints}"
        raise refuse("n_joints", code="A3", message=message)
    upper = tuple(int(i == 1) for i in range(n_joints))
    fore = tuple(int(i in (1, 2)) for i in range(n_joints))
    of_upper, of_fore = (_WAVES[k % 2] for k in quarters)
    return (
        JointTerm("gravity2.upper", 1, of_upper, upper),
        JointTerm("gravity2.fore", 1, of_fore, fore),
        JointTerm("gravity3.fore", 2, of_fore, fore),
    )


@cache
def harmonic_terms(n_joints: int, orders: tuple[int, ...] = (1, 2)) -> tuple[JointTerm, ...]:
    """Sine and cosine terms of each order per joint, as eccentric gears and encoders cause them."""
    return tuple(
        JointTerm(
            f"harmonic{i + 1}.{wave}{order}",
            i,
            wave,
            tuple(order * int(k == i) for k in range(n_joints)),
        )
        for i in range(n_joints)
        for order in orders
        for wave in _WAVES
    )
