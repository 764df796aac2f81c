"""Which of the statements about the tool point is to be believed here, and why, in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from calib.identification.fit_statistics import RED
from calib.identification.identify import Identification, Status
from calib.uncertainty.bootstrap import Bootstrap
from calib.uncertainty.conformal import Conformal
from calib.uncertainty.discrepancy import Discrepancy
from calib.uncertainty.held_out import HeldOut
from calib.uncertainty.validation import LinearCheck

StatementName = Literal["model", "bootstrap", "conformal", "discrepancy", "none"]


@dataclass(frozen=True, slots=True)
class Trust:
    """The statement to believe, and the reasons; what is not valid comes first."""

    believe: StatementName
    model_valid: bool
    """Whether the interval from the covariance of the parameters may be used at all."""
    sentences: tuple[str, ...]

    def __repr__(self) -> str:
        return f"Trust(believe={self.believe!r}, model_valid={self.model_valid})"

    @property
    def sentence(self) -> str:
        """All of it, as one text."""
        return " ".join(f"{part}." for part in self.sentences)


def trust(
    identification: Identification,
    *,
    held_out: HeldOut | None = None,
    discrepancy: Discrepancy | None = None,
    conformal: Conformal | None = None,
    bootstrap: Bootstrap | None = None,
    linear: LinearCheck | None = None,
    unmodelled: Sequence[str] = (),
) -> Trust:
    """Weigh the statements that were made for one identification.

    The model-based interval falls if the fit did not converge, if its residuals contradict the
    model, or if the errors at held-out poses do. Linear propagation alone failing leaves the
    bootstrap. What remains is believed in this order: model, bootstrap, conformal, discrepancy.

    Parameters
    ----------
    identification : Identification
        The fit with its chi-square test; with repeats, its lack-of-fit test.
    held_out, discrepancy, conformal, bootstrap : optional
        What else was computed.
    linear : Validation, optional
        Linear propagation against Monte Carlo.
    unmodelled : sequence of str
        What is known to be missing in the covariance, each reason enough not to use it.
    """
    against = _against(identification, held_out, unmodelled)
    other = _without_model(discrepancy, conformal)
    if identification.status is not Status.CONVERGED:
        believe: StatementName = "conformal" if conformal is not None else "none"
        return Trust(believe, False, (*against, *_advice(believe, discrepancy, conformal)))
    if against:
        return Trust(other, False, (*against, *_advice(other, discrepancy, conformal)))
    why = _for(identification, held_out)
    doubtful = [part.sentence for part in (bootstrap,) if part is not None and not part.agrees]
    if linear is not None and linear.outcome == "not validated":
        doubtful.append(linear.sentence)
    if doubtful:
        settled = bootstrap is not None and not bootstrap.unconverged
        use: StatementName = "bootstrap" if settled else other
        first = "The linear interval is not valid here: " + "; ".join(doubtful)
        return Trust(use, False, (first, *_advice(use, discrepancy, conformal)))
    extra = tuple(_capital(part.sentence) for part in (bootstrap, linear) if part is not None)
    return Trust("model", True, (why, *extra))


def _against(
    fit: Identification, held_out: HeldOut | None, unmodelled: Sequence[str]
) -> tuple[str, ...]:
    """Sentences against the model-based interval; the first states that it is not valid."""
    if fit.status is not Status.CONVERGED:
        return (f"The model-based interval is not valid: the fit {fit.status.value}",)
    reasons = []
    if fit.p_value < RED:
        reasons.append(
            f"the residuals contradict the model (chi-square {fit.chi_square / fit.dof:.2f} per "
            f"degree of freedom, p {_chance(fit.p_value)})"
        )
    lack = fit.lack_of_fit
    if lack is not None and lack.p_value < RED:
        reasons.append(
            f"the misfit is larger than the scatter of repeats explains (p {_chance(lack.p_value)})"
        )
    if held_out is not None and held_out.p_value < RED:
        reasons.append(
            f"errors at {len(held_out)} held-out poses are larger than it says (chi-square "
            f"{held_out.chi_square / (3 * len(held_out)):.2f} per degree of freedom, "
            f"p {_chance(held_out.p_value)})"
        )
    if fit.mode == "paper":
        reasons.append("an unweighted fit claims a covariance that its estimate does not have")
    reasons += unmodelled
    if not reasons:
        return ()
    return ("The model-based interval is not valid here: " + "; ".join(reasons),)


def _for(fit: Identification, held_out: HeldOut | None) -> str:
    """Why the model-based interval may be believed."""
    text = (
        "The model-based interval may be believed: the residuals are what the stated noise "
        f"explains (chi-square {fit.chi_square / fit.dof:.2f} per degree of freedom, "
        f"p {_chance(fit.p_value)})"
    )
    if fit.p_value > 1 - RED:
        text += ", even smaller: the interval is rather too wide"
    if held_out is not None:
        return text + f", and {len(held_out)} held-out poses agree (p {_chance(held_out.p_value)})"
    return text + "; no held-out pose has tested it"


def _without_model(discrepancy: Discrepancy | None, conformal: Conformal | None) -> StatementName:
    """What to believe once the model is out."""
    if conformal is not None:
        return "conformal"
    return "discrepancy" if discrepancy is not None else "none"


def _advice(
    believe: StatementName, discrepancy: Discrepancy | None, conformal: Conformal | None
) -> tuple[str, ...]:
    """What to use instead."""
    if believe == "conformal" and conformal is not None:
        return (f"Believe the conformal radius: {conformal.sentence}",)
    if believe == "discrepancy" and discrepancy is not None:
        return (
            f"Believe the interval with discrepancy, as an approximation: {discrepancy.sentence}",
        )
    if believe == "bootstrap":
        return ("Believe the replicates of the bootstrap: they need no linear model",)
    return (
        "No statement can be believed here: measure at least 19 independent poses where the robot "
        "will be used, or free the terms that the model leaves out",
    )


def _chance(p: float) -> str:
    """A p-value, also where it underflows."""
    return f"= {p:.2g}" if p > 0 else "< 1e-300"


def _capital(text: str) -> str:
    """With a capital letter."""
    return text[:1].upper() + text[1:]
