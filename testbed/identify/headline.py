"""The table of errors of every model, before and after, and what its figures are called."""

from calib.information.reduction import Reduction
from calib.uncertainty.statement.stated_point import StatedPoint
from testbed.identify.calibration import Calibration
from testbed.identify.records import Figures
from testbed.units import DEG, MM, decimals, fixed, significant

HEAD = (
    "model", "mean mm", "p95 mm", "max mm", "mean deg", "max deg", "training mm", "χ²/dof",
)  # fmt: skip


def headline_cells(calibration: Calibration) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Head and rows without the columns that say nothing of these readings."""
    rows = headline_rows(calibration)
    told = [k for k in range(len(HEAD)) if any(row[k] != "–" for row in rows)]
    return tuple(HEAD[k] for k in told), tuple(tuple(row[k] for k in told) for row in rows)


def headline_rows(calibration: Calibration) -> tuple[tuple[str, ...], ...]:
    """Before, and each model: figures at the held-out rows, else at the training rows."""
    before = _figures(calibration.before_test, calibration.before_train)
    rows = [("nominal, frames fitted", *before, "–")]
    for fit in calibration.fits:
        result = fit.identification
        chosen = fit is calibration.fit and len(calibration.fits) > 1
        rows.append(
            (
                f"{fit.model} (chosen)" if chosen else fit.model,
                *_figures(fit.test, fit.train),
                significant(result.chi_square / result.dof, 3) if result.dof > 0 else "–",
            )
        )
    return tuple(rows)


def _figures(test: Figures | None, train: Figures) -> tuple[str, ...]:
    """Cells of one model."""
    shown = train if test is None else test
    p, r = shown.position, shown.rotation
    turns = ("–",) * 2 if r is None else (deg(r.mean), deg(r.maximum))
    lengths = (p.mean, p.p95, p.maximum)
    return (*(mm(value) for value in lengths), *turns, mm(train.position.mean))


def condition(reduction: Reduction) -> str:
    """Condition of the kept columns; empty where a prior keeps what the data cannot tell apart."""
    return significant(reduction.condition, 3) if reduction.told_apart else ""


def mm(length: float) -> str:
    """A length [m] in mm to a micrometre, or to its second digit if that is smaller."""
    return fixed(length * MM, max(3, decimals(length * MM, 2)))


def deg(angle: float) -> str:
    """An angle [rad] in deg to a thousandth, or to its second digit if that is smaller."""
    return fixed(angle * DEG, max(3, decimals(angle * DEG, 2)))


def r95(point: StatedPoint) -> str:
    """What a radius is called, with its dimension and probability."""
    held = 100 * point.probability
    return f"R{held:g} (3-D radius, {held:g} %)"


def kind(calibration: Calibration) -> str:
    """What is missed."""
    far = bool(calibration.measurements.is_distance.all())
    return "mean distance error" if far else "mean position error"
