"""The report's section on the parameters: identified, true, and inside what was stated."""

import numpy as np

from calib.geometry.model import RobotModel
from calib.geometry.parameters import shown_in
from testbed.report.page import Block, Figure, Section, Table, Text, heads
from testbed.scenario.fixtures import targets_mm
from testbed.scenario.scenario import Scenario
from testbed.studies.trial import plots, plots_uncertainty
from testbed.studies.trial.compare import held_by_repeats
from testbed.studies.trial.records import Campaign, Estimate, Trial
from testbed.units import counted, fixed, with_uncertainty

NONE = "–"
TOP = 6
"""Parameters in the table of a report."""
SPRUNG = (
    " Compliances, moments and tilts have no U of their own: what springs bend together is "
    "measured, and one number of them stands for what the model lacks as well. A true bend is the "
    "load over the stiffness; – where nothing in the true robot defines a number."
)


def parameter_section(campaign: Campaign) -> Section:
    """Every error of the first trial in a figure, its largest changes in a table."""
    trial = campaign.trials[0]
    estimate = trial.estimates[0]
    said = "All numbers of all trials are in arrays.npz." + SPRUNG * (
        estimate.identification.model.joint_errors.springs is not None
    )
    blocks: list[Block] = [
        Figure(
            f"{trial.name}: error of each number in units of its stated u (fit), and how often "
            "its interval held the truth.",
            plots_uncertainty.parameter_errors(trial),
        ),
        parameter_table(campaign.setting.nominal, trial, estimate, TOP),
        Text(said + fixture_names(campaign.scenario)),
    ]
    return Section("parameters", "Parameters", tuple(blocks), part="detail")


def fixture_names(scenario: Scenario) -> str:
    """What the scenario calls the reflectors and anchors that are numbered; empty without any."""
    settings = scenario.fixtures
    if settings is None:
        return ""
    free = [name for name in targets_mm(scenario) if name in settings.free]
    named = [f"reflector{k + 1} is {name}" for k, name in enumerate(free)]
    named += [f"anchor{k + 1} is {name}" for k, name in enumerate(settings.anchors_mm)]
    stations = " Station rows are displacements like those of base and tool."
    return f" In [fixtures] {', '.join(named)}." * bool(named) + stations * bool(
        settings.stations_mm
    )


def parameter_table(
    nominal: RobotModel, trial: Trial, estimate: Estimate, most: int | None = None
) -> Table:
    """Nominal, identified, true, error, U and inside for every parameter of one estimate.

    With `most`, only for those that changed most in units of their own u, largest first.
    """
    found, seen = estimate.identification, estimate.comparison
    is_length = found.parameters.is_length[found.parameters.free_index]
    # base, tool and stations are displacements: nominal is zero
    links, errors = nominal.chain.links.ravel(), nominal.joint_errors.coefficients
    points = [nominal.fixtures.reflectors.ravel(), nominal.fixtures.anchors.ravel()]
    stations = np.zeros(6 * len(nominal.fixtures.stations))
    start_values = np.concatenate([np.zeros(6), links, np.zeros(6), errors, *points, stations])
    known = dict(zip(nominal.names, start_values, strict=True))
    at = np.array([known.get(name, 0.0) for name in found.names])
    defined, judged = np.isfinite(seen.true_step), estimate.judged
    springs = found.model.joint_errors.springs
    together = () if springs is None else springs.names
    step_there = np.where(defined, seen.true_step, found.step)
    values = (at, found.step, step_there, found.standard_uncertainty, estimate.type_a)
    units = [shown_in(*one) for one in zip(found.names, is_length.tolist(), strict=True)]
    start, step, true, u, type_a = np.array(values) * [scale for _, scale in units]
    (held, factor), freedom = held_by_repeats(estimate), len(estimate.repeated) - 1
    rows = []
    order = np.arange(len(found.names))
    if most is not None:
        order = np.argsort(-np.abs(step) / u, kind="stable")[:most]
    for k in order:
        name = found.names[k]
        written = with_uncertainty(
            start[k] + step[k], u[k], start[k] + true[k], true[k] - step[k], 2 * u[k]
        )
        identified, _, truth, error, expanded = written
        repeated = with_uncertainty(0.0, type_a[k])[1]
        inside = "yes" if seen.parameter_inside[k] else "NO"
        at_start = f"{start[k]:g}".replace("-", "−")
        by_repeats = "yes" if held[k] else "NO"
        if not defined[k]:
            truth = error = NONE
        if not judged[k]:
            expanded, inside, by_repeats = NONE if name in together else expanded, NONE, NONE
        cells = (identified, truth, error, expanded, repeated, inside, by_repeats)
        rows.append((name, units[k][0], at_start, *cells))
    shown = "" if len(rows) == len(found.names) else f"; the {len(rows)} that changed most"
    return Table(
        caption=f"{trial.name}, {plots.NAMES[estimate.mode]}: "
        f"{int(seen.parameter_inside.sum())} of {int(judged.sum())} inside by the fit's "
        f"covariance, {int(held[judged].sum())} by the scatter of repeats (type A){shown}",
        head=heads(
            "parameter, unit, nominal, identified, true, error, U of fit (1-D: 95.4 %), "
            f"s of {counted(len(estimate.repeated), 'repeat')}, inside fit, inside t s"
        ),
        rows=tuple(rows),
        align="llrrrrrrll",
        size="small",
        note="error: true minus identified. U = 2 u, if the model lacks nothing. s: scatter of "
        f"repeats (type A); its 95 % interval is t s with Student's t = {fixed(factor, 2)} for "
        f"{freedom} {'degree' if freedom == 1 else 'degrees'} of freedom. Base and tool: "
        "displacements along and about their axes. true: expressed in the numbers that were "
        "estimated.",
    )
