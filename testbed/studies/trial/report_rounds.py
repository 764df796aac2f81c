"""The report's table of what every trial's poses showed of each target, from each place."""

from collections.abc import Iterator

from testbed.laboratory.tracker.rounds import first_tracker, rounds_of
from testbed.report.page import Table, heads
from testbed.scenario.fixtures import targets_mm
from testbed.studies.trial import plots
from testbed.studies.trial.records import Campaign
from testbed.units import counted


def round_tables(campaign: Campaign) -> Iterator[Table]:
    """One table of the rows that each round brought; none where there is one target only."""
    scenario, nominal = campaign.scenario, campaign.setting.nominal
    settings = scenario.fixtures
    if settings is None:
        return
    trials = plots.shown(campaign)
    rounds = rounds_of(scenario, first_tracker(scenario, nominal.chain), nominal.fixtures)
    points = scenario.tracker.measures == "point"
    judged = next(iter(targets_mm(scenario))) if points else "the tool's origin"
    rows = []
    for one in rounds:
        found = [one.target] * (one.target in settings.free)
        found += [one.place] * (one.station > 0 or one.place in settings.free)
        seen = (str(len(one.rows_in(trial.measurements))) for trial in trials)
        rows.append((one.place, one.target or "6-D target", one.kind, ", ".join(found), *seen))
    yield Table(
        caption="Rows of the first visit: the program ran once for every target from every place",
        head=(*heads("from, target, measured, to be found"), *(trial.name for trial in trials)),
        rows=tuple(rows),
        align="llll" + "r" * len(trials),
        note=f"A visit is {counted(len(rounds), 'run')} of the program. A pose has a row where the "
        "target faces the place and nothing stands between. to be found: not known before, but "
        f"part of the calibration. Errors are judged at {judged}; held-out poses are measured by "
        "the tracker alone.",
    )
