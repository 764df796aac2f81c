"""Errors of geometric numbers over their uncertainties, for robots that a model can match."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.geometry.many import ManyModels
from calib.identification.identify import Identification
from calib.identification.many.fit import fit_many
from calib.identification.many.tables import ManyTables, known_to_many
from calib.measurement.accuracy import point_distances
from calib.uncertainty.covariance import standard_uncertainty
from calib.uncertainty.regions import mahalanobis_squared
from testbed.laboratory.truth.terms import UnmodelledTerms
from testbed.studies.coverage.judge import MeasuredRobot
from testbed.studies.trial.compare import true_step
from testbed.studies.trial.statement.sources import systematic_covariance

EXACT = 1e-9
"""Largest error at which a model counts as matching the noise-free truth [m]."""

Errors = tuple[Array, float]
"""Normalized errors (f,) and NEES of the geometric numbers."""


def parameter_errors(found: Identification, measured: MeasuredRobot) -> Errors | None:
    """Errors of one robot; None if the geometric model cannot match the truth.

    It cannot if joints or links have errors beyond geometry, or if numbers that differ are held.
    """
    if not _geometric(measured):
        return None
    setting = measured.laboratory.setting
    step = true_step(setting, found, measured.seen)
    exact = setting.nominal.moved(found.parameters.expand(step))
    return _in_uncertainties(found, measured, step, exact.poses(measured.judge_q)[:, :3, 3])


def many_parameter_errors(
    found: Sequence[Identification], measured: Sequence[MeasuredRobot]
) -> list[Errors | None]:
    """Errors of each robot of a kind, as in `parameter_errors`.

    Whether numbers can match the truth is tested at noise-free poses. These are the identification
    poses, the same for all robots, so that one joint fit is enough.
    """
    nominal, parameters = measured[0].laboratory.setting.nominal, found[0].parameters
    tables = ManyTables.alike([one.seen for one in measured])
    together = (
        all(fit.prior is None and (fit.parameters.free == parameters.free).all() for fit in found)
        and all(map(_geometric, measured))
        and tables is not None
        and len(tables.q) == 1
        and known_to_many(nominal)
    )
    if not together or tables is None:
        return [parameter_errors(*one) for one in zip(found, measured, strict=True)]
    # joint errors of the nominal model are part of the comparison
    true = ManyModels.each(
        nominal,
        [
            replace(one.laboratory.setting.true, joint_errors=nominal.joint_errors)
            for one in measured
        ],
    )
    T = true.poses(tables.q)
    seen = ManyTables.read(tables.q, T[:, :, :3, 3], T[:, :, :3, :3], tables.covariance)
    exact = fit_many(nominal, seen, parameters, shared=True)
    p = exact.models.poses(np.array([one.judge_q for one in measured]))[:, :, :3, 3]
    return [
        _in_uncertainties(fit, one, exact.steps[k], p[k])
        if exact.converged[k]
        else parameter_errors(fit, one)
        for k, (fit, one) in enumerate(zip(found, measured, strict=True))
    ]


def _geometric(measured: MeasuredRobot) -> bool:
    """Whether some geometry can match a robot."""
    truth = measured.laboratory.truth
    return not truth.model.joint_errors.coefficients.any() and truth.unmodelled == UnmodelledTerms()


def _in_uncertainties(
    found: Identification, measured: MeasuredRobot, step: Array, p: Array
) -> Errors | None:
    """Errors against a true step (f,), with its points p (t, 3) at the judging poses [m]."""
    if point_distances(p, measured.true).max() > EXACT:
        return None
    wrong = found.step - step
    covariance = found.covariance + systematic_covariance(measured.laboratory, found, measured.seen)
    nees = float(mahalanobis_squared(wrong, covariance))
    return wrong / standard_uncertainty(covariance), nees
