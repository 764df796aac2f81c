"""What is stated of the tool point, for result.json: radii, tests, targets, decisions."""

import numpy as np

from calib.uncertainty.statement.belief import Belief
from calib.uncertainty.statement.stated_point import StatedPoint
from testbed.identify.applies.targets import named
from testbed.identify.calibration import Calibration
from testbed.identify.decisions import decided_at, decision_line, decision_words, would_decide
from testbed.identify.handback.delivered import Delivered, TargetStatement
from testbed.identify.statements import statements_of
from testbed.store.quantities import METRE, Quantity, below, stated, unitless


def statements(calibration: Calibration) -> list[Quantity]:
    """What may be said of the tool's position at a new pose, and what the readings were asked."""
    proof, asked = calibration.proof, calibration.proof.questions
    out = [
        Quantity("refuted", proof.trust.refuted),
        *(
            Quantity(f"compared/{one.key}/R95_um", one.radius, METRE)
            for one in statements_of(calibration)
        ),
        *(
            Quantity(f"compared/{one.key}/{name}", getattr(one, name))
            for one in statements_of(calibration)
            for name in ("promise", "use")
        ),
        *(
            Quantity(f"tests/{name}", {"p": p, "p_for_all": adjusted, "said": name in asked.said})
            for name, p, adjusted in zip(asked.names, asked.p_values, asked.adjusted, strict=True)
        ),
        Quantity("tests/residuals and held-out errors/p", asked.combined),
    ]
    if proof.point is not None and proof.belief is not None:
        out += _region(proof.point, proof.belief)
    if proof.held_out is not None:
        out.append(Quantity("held_out_p_value", proof.held_out.p_value))
    if proof.discrepancy is not None:
        size = np.sqrt(np.trace(proof.discrepancy.covariance))
        out.append(Quantity("discrepancy_u_3d_mm", size, METRE))
    if proof.conformal is not None:
        out += [
            Quantity("conformal_radius_mm", proof.conformal.radius, METRE),
            Quantity("conformal_probability", proof.conformal.probability),
            Quantity("conformal_content_range", proof.conformal.content_range()),
        ]
    return out


def targets(found: TargetStatement | None) -> list[Quantity]:
    """What is stated at the targets of a program; nothing without one."""
    if found is None:
        return []
    names, places = named(found)
    words: dict[str, object] = {
        "name": names,
        "where": places,
        "transfer": found.transfer,
        "leverage": found.leverage,
        "place": found.place,
        "stated": found.stated,
        "why": found.why,
        "reaches": found.reaches,
    }
    radii = {"R95_mean_um": found.radius_mean, "R95_move_um": found.radius_move}
    return [
        *(
            Quantity(name, [x if found.stated[k] else None for k, x in enumerate(radius)], METRE)
            for name, radius in ((name, radius.tolist()) for name, radius in radii.items())
        ),
        *unitless(words),
    ]


def decisions(calibration: Calibration, delivered: Delivered) -> list[Quantity]:
    """Whether points keep the tolerance; nothing without one."""
    found = decided_at(calibration, delivered)
    if not found:
        said = decision_words(calibration, delivered)
        return [Quantity("sentence", said[0])] if said else []
    rule = found[0].rule
    out = [
        stated("tolerance_um", found[0].by.tolerance, METRE),
        Quantity("rule", rule),
        Quantity("sentence", decision_line(found)),
        Quantity("would_decide", would_decide(calibration) or None),
    ]
    for one in found:
        band = float(one.by.guard.max()) if one.by.rule == "guarded" else None
        own = [
            Quantity("decision", one.word),
            *unitless(one.counts),
            Quantity("largest_risk_of_a_pass", one.risk),
            Quantity("largest_guard_band_R95_um", band, METRE),
        ]
        out += below(one.key, own)
    return out


def _region(point: StatedPoint, belief: Belief) -> list[Quantity]:
    """The believed region at poses like those that it is of, as single numbers."""
    sizes = {
        "u_mean_um": point.u_mean,
        "u_move_um": point.u_move,
        "R95_mean_um": point.radius_mean,
        "R95_move_um": point.radius_move,
        "misfit_upper_um": belief.misfit.upper,
        "misfit_best_um": belief.misfit.best,
        "detectable_um": belief.misfit.detectable,
    }
    others: dict[str, object] = {
        "probability": point.probability,
        "factor": belief.factor,
        "guards": belief.n_guards,
        "poses_ranged": belief.n_ranged,
        "poses": point.n_poses,
        "poses_held_out": point.held_out,
        "move_told_by": point.move_told_by,
        "relative": point.relative,
        "noise_scale": belief.misfit.noise_scale,
        "noise_told_by_repeats": belief.misfit.repeated,
    }
    return [*(Quantity(name, x, METRE) for name, x in sizes.items()), *unitless(others)]
