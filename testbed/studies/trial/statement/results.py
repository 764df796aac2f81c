"""The statement of each calibration, and the secret, in result.json."""

import numpy as np

from testbed.store.quantities import METRE, Quantity, below, fields_of
from testbed.studies.trial.statement.records import LEVEL, Statement, Validation


def statement_headline(statement: Statement) -> list[Quantity]:
    """What may be believed of one calibration, with its figures."""
    held_out, lack, played = statement.held_out, statement.lack_of_fit, statement.bootstrap
    evidence, discrepancy = statement.log_evidence, statement.discrepancy_u
    out = [
        Quantity("model/chosen", statement.model),
        Quantity("model/sentence", statement.why),
        *([] if np.isnan(evidence) else [Quantity("model/log_evidence", evidence)]),
        Quantity("outlier_poses", statement.outlier_poses),
        Quantity("set_aside_poses", statement.set_aside),
        Quantity("validation/poses", len(held_out)),
        Quantity("validation/chi_square_per_dof", held_out.chi_square / (3 * len(held_out))),
        Quantity("validation/p_value", held_out.p_value),
        Quantity("validation/mean_error_um", held_out.distance.mean(), METRE),
        Quantity("level", LEVEL),
    ]
    for name, radius, share in zip(
        statement.names, statement.radius, statement.attained, strict=True
    ):
        out += [
            Quantity(f"statements/{name}/radius_um", radius, METRE),
            Quantity(f"statements/{name}/attained", share),
            Quantity(f"statements/{name}/believed", name == statement.trust.believe),
        ]
    budget = dict(zip(statement.sources, statement.source_u, strict=True))
    out += [
        Quantity("trust/believe", statement.trust.believe),
        Quantity("trust/model_valid", statement.trust.model_valid),
        Quantity("trust/reasons", statement.trust.sentences),
        Quantity("budget_u_3d_um", {**budget, "combined": statement.combined_u}, METRE),
        Quantity("discrepancy_u_3d_um", None if np.isnan(discrepancy) else discrepancy, METRE),
        Quantity("linear/outcome", statement.linear.outcome),
        Quantity("linear/sentence", statement.linear.sentence),
        Quantity("warnings/count", len(statement.warnings)),
        Quantity("warnings/reasons", statement.warnings),
    ]
    if lack is not None:
        out += below("lack_of_fit", fields_of(lack, {"ratio": "ratio", "p_value": "p_value"}))
    if played is not None:
        names = {"replicates": "replicates", "agrees": "agrees", "worst_sd_ratio": "worst"}
        out += below("bootstrap", fields_of(played, names))
    return out


def truth_headline(validation: Validation) -> list[Quantity]:
    """The secret: how far each term of the truth alone moves the tool, over held-out poses."""
    terms = dict(zip(validation.terms, validation.term_rms, strict=True))
    return [
        Quantity("terms_rms_mm", terms, METRE),
        Quantity("together_rms_mm", validation.together_rms, METRE),
        Quantity("interaction_rms_mm", validation.interaction_rms, METRE),
    ]
