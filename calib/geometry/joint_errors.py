"""Joint errors outside the geometry: gravity sag and gear harmonics, and springs under load.

dq(q) = sum_k c_k b_k(q), each b_k a sine or cosine of a combination of joint values, or what a row
says beside its joints, and each acting on one joint. An amplitude with a phase is two terms:
A sin(q + phi) = (A cos phi) sin q + (A sin phi) cos q. Springs bend a joint about any axis. One
term moves no joint: the lengths of a warm arm.
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
"""`joint` of a term that moves none."""


@dataclass(frozen=True, slots=True)
class JointTerm:
    """One basis function and the joint it turns.

    A wave b(q) = sin or cos(weights . q), or a linear form of what a row says beside its joints:
    weights . directions of approach, or weights . reported torques - reference. Of the term
    "lengths" it is the temperature - reference, and the coefficient is the expansion [1/K] of d and
    a of all links. What a row does not say counts as the reference, and as no direction.
    """

    name: str
    """Public name, e.g. ``gravity2.sin2`` or ``harmonic3.cos1``."""
    joint: int
    """Joint that is displaced, 0-based; -1 of lengths."""
    wave: Wave
    weights: tuple[float, ...]
    """(n,) factor of each joint value inside the wave, or of each direction or torque; zero of
    lengths."""
    reference: Annotated[float, LATER] = 0.0
    """Torque or temperature at which the term is zero: their mean where it was identified [N m,
    degC]."""
    share: Annotated[float, LATER] = 1.0
    """How large its coefficient is believed to be, in units of what is usual of its kind; of a
    torque for each N m [1/(N m)]."""

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
        """Waves a turn of a term of one joint."""
        return max(abs(weight) for weight in self.weights)

    @property
    def is_wave(self) -> bool:
        """Whether it depends on the joints alone."""
        return self.wave in _WAVES

    def of_rows(self, at: OperatingConditions, m: int) -> Array:
        """Values (m,) of a term that is no wave."""
        if self.wave == "lengths":
            return np.zeros(m) if at.temperature is None else at.temperature - self.reference
        said = at.approach if self.wave == "approach" else at.torque
        if said is None:
            return np.zeros(m)
        return np.asarray(said @ np.array(self.weights, dtype=np.float64) - self.reference)


@dataclass(frozen=True, slots=True, eq=False)
class JointErrors:
    """A sum of joint terms with their coefficients; empty for a purely geometric robot."""

    terms: tuple[JointTerm, ...] = ()
    coefficients: Array = ()  # type: ignore[assignment]  # becomes an array in __post_init__
    """(k + s,) one coefficient per term, then the numbers of the springs; all zero if left out
    [rad or m; kg or kg m for moments]."""
    springs: Annotated[SprungJoints | None, LATER] = None
    """What gives way under load, if anything."""

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
        """Refuse errors of another arm than `chain`."""
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
        """(k + s,) names of the terms and of the springs' numbers."""
        sprung = () if self.springs is None else self.springs.names
        return (*(term.name for term in self.terms), *sprung)

    @property
    def joints(self) -> list[int]:
        """(k,) displaced joint of each term, 0-based; -1 where it moves none."""
        return [term.joint for term in self.terms]

    @property
    def of_lengths(self) -> list[int]:
        """Places of the terms that are lengths."""
        return [k for k, term in enumerate(self.terms) if term.joint == NO_JOINT]

    def basis(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """Values b_k (m, k) of poses at joints q (m, n) under some conditions.

        Dimensionless; of torques in N m, of lengths in K.
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
        """Whether anything but the joints moves them under some conditions."""
        of_rows = {"lengths": "temperature"}
        asked = {of_rows.get(term.wave, term.wave) for term in self.terms if not term.is_wave}
        return bool({*asked, *(("payload",) if self.springs else ())} & {*at.stated})

    def growth(self, at: OperatingConditions) -> Array | None:
        """Part (m,) by which lengths have grown; None where none do, or nothing says how warm."""
        if at.temperature is None or not self.of_lengths:
            return None
        m = len(at.temperature)
        grown = [self.coefficients[k] * self.terms[k].of_rows(at, m) for k in self.of_lengths]
        return np.asarray(sum(grown))

    def offsets(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """Joint offsets dq (m, n) [rad or m] at joint values q (m, n), where nothing gives way."""
        if self.springs is not None:
            raise refuse(
                "springs", code="A3",
                message="these joint errors have springs, which bend a joint about three axes",
                allowed="here joint terms alone, which are offsets of joint values",
                fix="take the poses from the robot model, or leave the springs out",
            )  # fmt: skip
        return self.of_terms(q, at)

    def bends(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """Bends (m, n, 3) about x, y, z of every joint [rad or m] at joint values q (m, n)."""
        out = np.zeros((*q.shape, 3))
        if self.springs is not None:
            out = self.springs.bends(q, self.of_springs, at.moments)
        out[:, :, Z] += self.of_terms(q, at)
        return out

    def joined(self, other: "JointErrors") -> "JointErrors":
        """Both of them as one; springs stand after all terms, and only one of them may have any."""
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
        """(s,) the coefficients that belong to the springs."""
        return self.coefficients[len(self.terms) :]

    def of_terms(self, q: Array, at: OperatingConditions = AS_USUAL) -> Array:
        """What the terms displace of each joint (m, n) [rad or m]."""
        return self.moved_by(self.basis(q, at), q.shape[1])

    def moved_by(self, basis: Array, n_joints: int) -> Array:
        """The same by the values (m, k) of the terms."""
        each = (basis * self.coefficients[: len(self.terms)]).T
        dq, joints = np.zeros((len(basis), n_joints)), np.array(self.joints, dtype=np.int64)
        for joint in sorted({*self.joints} - {NO_JOINT}):
            dq[:, joint] = each[joints == joint].sum(axis=0)
        return dq


@cache
def gravity_terms(n_joints: int, quarters: tuple[int, int] = (0, 0)) -> tuple[JointTerm, ...]:
    """Sag of a vertical-plane arm: dq2 = g1 sin q2 + g2 sin(q2+q3), dq3 = g3 sin(q2+q3).

    Closed form for an arm whose joints 2 and 3 have parallel horizontal axes and whose zero pose is
    the candle; positive coefficients droop away from it. Where the zero pose is another one,
    `quarters` is how many quarter turns from upright the upper arm and the forearm lie there, and
    cosines stand for the sines of odd ones: the UR10, level at zero, has (1, 1).
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
    """Sine and cosine of each order per joint: what an eccentric gear or encoder leaves."""
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
