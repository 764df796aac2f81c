"""The result of an identification: model, estimated numbers, covariance and tests, also as text."""

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, NamedTuple

import numpy as np

from calib.arrays import Array, FloatOrNan, frozen
from calib.geometry.chain import Chain
from calib.geometry.fixtures import Fixtures
from calib.geometry.model import RobotModel
from calib.geometry.parameters import Parameters, shown_in
from calib.identification.lack_of_fit import LackOfFit
from calib.identification.least_squares import Status
from calib.identification.prior import Prior, step_derivative
from calib.identification.robust import Loss
from calib.information.reduction import Reduction
from calib.shown import ResultTable, Shown, decimals

Mode = Literal["whitened", "paper"]
ILL_CONDITIONED = 1e3
"""Condition number of the kept columns above which the poses are too much alike."""


class Reason(NamedTuple):
    """Which model is fitted and why, in parts."""

    model: str
    """geometric or extended."""
    levels: str
    """By which levels it was extended; empty where it was not."""
    because: str

    @property
    def sentence(self) -> str:
        """All of it."""
        return f"{self.model}{self.levels}: {self.because}"


@dataclass(frozen=True, slots=True, eq=False)
class Identification(Shown):
    """An identified robot with the numbers that were really estimated and their covariance."""

    model: RobotModel
    """The identified model; numbers that were not estimated have their nominal values."""
    parameters: Parameters
    """Parameter table in which the f estimated numbers are free: the kept ones of `reduction`, and
    all that have a prior."""
    reduction: Reduction
    """What the measurements alone can tell apart, judged at the nominal model."""
    step: Annotated[Array, "f"]
    """(f,) estimate minus nominal [m, rad]; of a frame (base, tool, station) in its own axes."""
    covariance: Annotated[Array, "f", "f"]
    """(f, f) of `step` [m^2, m rad, rad^2]: inv(A'A + Lambda0); with a robust loss the sandwich; in
    paper mode the claimed s^2 inv(H'H)."""
    chi_square: FloatOrNan
    """Whitened sum of squares of the measurements; nan in paper mode, which knows no noise to
    compare with. With a robust loss, without the observations that the notes name."""
    dof: int
    """Rows minus numbers estimated; with a prior the whole number nearest to `dof_effective`."""
    p_value: FloatOrNan
    """Chance of a larger chi-square if model and noise are right; nan in paper mode."""
    variance: float
    """Factor of the covariance: 1, or in paper mode s^2 = RSS / (12 m - f), row units squared."""
    rank: int
    """Numbers estimated, f."""
    certificate: float
    """Relative offset at the end; see `Tangent.certificate`."""
    status: Status
    """How the fit ended; its value is a sentence."""
    iterations: int
    trace: Array
    """(iterations + 1,) sum of squares from the nominal model on, that of the prior included; with
    a robust loss the loss, from the answer on that it started with."""
    residual: Annotated[Array, "N"]
    """(N,) measured minus predicted at the end: whitened, or the paper's rows in 1 and mm."""
    mode: Mode
    notes: tuple[str, ...]
    """Sentences on what limits the result."""
    prior: Prior | None = None
    """The prior, as it was weighed in the fit."""
    loss: Loss = "squared"
    """Loss that was minimized."""
    weights: Annotated[Array, "m"] = field(default_factory=lambda: frozen(()))
    """(m,) weight of each observation, 0 to 1; ones for the squared loss."""
    dof_effective: FloatOrNan = float("nan")
    """n - tr[inv(A'A + Lambda0) A'A]: rows minus numbers learned from the measurements."""
    log_evidence: FloatOrNan = float("nan")
    """Log evidence of model and prior by Laplace's method, up to a constant of the table:
    -(loss + x'Lambda0 x)/2 + ln|Lambda0|/2 - ln|A'A + Lambda0|/2. nan unless every number estimated
    has a prior."""
    lack_of_fit: LackOfFit | None = None
    """Misfit against the scatter of repeats; None without repeats or with a robust loss."""
    tightened: float = 1.0
    """Precision of the prior as weighed in the fit, over that given; above one if there is more
    noise than stated."""

    def __repr__(self) -> str:
        if self.mode == "paper":
            test = f"s^2 = {self.variance:.3g}"
        else:
            test = f"chi-square {self.chi_square:.4g} of {self.dof}, p = {self.p_value:.2g}"
        return f"Identification({self.rank} numbers, {self.status.name.lower()}, {test})"

    @property
    def names(self) -> tuple[str, ...]:
        """(f,) names of the numbers estimated."""
        return self.parameters.free_names

    @property
    def standard_uncertainty(self) -> Array:
        """(f,) square roots of the diagonal of the covariance [m, rad].

        Of the steps, those of a frame along its own axes. The table in `summary` and `tables` has U
        of the values instead: of the base along the axes of the world, of a tool along those of the
        flange, as `calib.identification.result.values_and_uncertainties` gives them.
        """
        return np.sqrt(np.diag(self.covariance))

    @property
    def full_covariance(self) -> Array:
        """(P, P) of all numbers [m^2, m rad, rad^2]; zero where one was not estimated."""
        full = np.zeros((len(self.parameters.names),) * 2)
        index = self.parameters.free_index
        full[np.ix_(index, index)] = self.covariance
        return full

    @property
    def least_known(self) -> int:
        """Index (of f) of the number with the largest standard uncertainty for its scale."""
        return int(np.argmax(self.standard_uncertainty / self.parameters.free_scale))

    @property
    def shown_in(self) -> tuple[tuple[str, ...], Array]:
        """(f,) unit in which people read each number, and its value in that unit per SI unit."""
        lengths = self.parameters.is_length[self.parameters.free_index].tolist()
        pairs = [shown_in(*one) for one in zip(self.names, lengths, strict=True)]
        return tuple(unit for unit, _ in pairs), np.array([scale for _, scale in pairs])

    @property
    def notes_of_fit(self) -> tuple[str, ...]:
        """The notes but those on what cannot be told apart, which `reduction` has."""
        told = set(self.reduction.sentences)
        return tuple(note for note in self.notes if note not in told)

    def tables(self) -> dict[str, ResultTable]:
        """``numbers`` with value, U (k = 2) and unit; ``residuals``, whitened."""
        return {"numbers": numbers(self), "residuals": ResultTable({"residual": self.residual})}

    def summary(self) -> str:
        """Text with the numbers and their U (k = 2), the tests of the fit, and all notes."""
        return "\n".join([*_table(self), "", *_tests(self), *_remarks(self)])


def values_and_uncertainties(result: Identification) -> tuple[Array, Array]:
    """All numbers of the identified model and their standard uncertainties (P,) [m, rad].

    Base and stations are given as position and rotation vector in the world, tools in the flange.
    They are estimated as steps in their own axes, from which the uncertainty is propagated. The
    table of an identification shows those that were estimated, with U = 2 u, in mm and deg.
    """
    chain, fixtures = result.model.chain, result.model.fixtures
    errors = result.model.joint_errors
    nothing = RobotModel(
        Chain(np.zeros_like(chain.links), chain.kinds),
        replace(errors, coefficients=np.zeros_like(errors.coefficients)),
        Fixtures(
            np.zeros_like(fixtures.reflectors),
            np.zeros_like(fixtures.anchors),
            *(
                np.tile(np.eye(4), (len(some), 1, 1))
                for some in (fixtures.stations, fixtures.tools)
            ),
        ),
    )
    values = nothing.step_to(result.model)
    moves = step_derivative(values, result.model)
    variance = np.diagonal(moves @ result.full_covariance @ moves.T)
    return values, np.sqrt(np.maximum(variance, 0.0))  # rounding may leave a hair below


def numbers(result: Identification) -> ResultTable:
    """Estimated numbers in readable units; U (k = 2) is nan for springs, which have none alone."""
    values, u = values_and_uncertainties(result)
    springs = result.model.joint_errors.springs
    together = () if springs is None else springs.names
    place = result.parameters.free_index
    units, scale = result.shown_in
    return ResultTable(
        {
            "name": result.names,
            "value": scale * values[place],
            "U": np.where(np.isin(result.names, together), np.nan, 2 * scale * u[place]),
            "unit": units,
        },
        precision="U",
    )


def _table(result: Identification) -> list[str]:
    """Lines with name, value, U and unit of each number that was estimated."""
    width = max(map(len, result.names), default=0)
    lines = [f"{'':{width}}  {'value':>14}  {'U (k = 2)':>12}  unit"]
    for name, value, U, unit in zip(*numbers(result).values(), strict=True):
        places = decimals(U)
        stated = "with others" if np.isnan(U) else f"{U:.{places}f}"
        lines.append(f"{name:{width}}  {value:z14.{places}f}  {stated:>12}  {unit}")
    return lines


def _tests(result: Identification) -> list[str]:
    """Lines on how the fit ended and whether the residuals are what the noise explains."""
    lines = [f"{result.rank} numbers from {len(result.residual)} rows: {result.status.value}"]
    if result.mode == "paper":
        return [*lines, f"s^2 = {result.variance:.4g} of unweighted rows [1, mm]"]
    each = f" ({result.chi_square / result.dof:.2f} each)" if result.dof > 0 else ""
    lines.append(
        f"chi-square {result.chi_square:.1f} for {result.dof} degrees of freedom{each}, "
        f"p = {result.p_value:.2g}"
    )
    if result.lack_of_fit is not None:
        lack = result.lack_of_fit
        lines.append(f"lack of fit against repeats: F = {lack.ratio:.2f}, p = {lack.p_value:.2g}")
    return lines


def _remarks(result: Identification) -> list[str]:
    """Lines on what cannot be told apart, and warnings."""
    lines = [f"note: {note}" for note in result.notes]
    if result.reduction.told_apart and result.reduction.condition > ILL_CONDITIONED:
        lines.append(
            f"warning: the poses are much alike (condition {result.reduction.condition:.1e}); "
            f"least known is {result.names[result.least_known]}; vary the wrist and the "
            "orientation of the tool more"
        )
    return lines
