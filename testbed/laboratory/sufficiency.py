"""Whether a scenario can be measured, and enough for what it identifies, known before any is."""

from dataclasses import replace

from calib.errors import refuse
from testbed.laboratory.bench import PROBED_POSES, Bench, open_bench
from testbed.laboratory.tracker.stations import require_ranges, require_stations
from testbed.scenario.laboratory import At960Tracker
from testbed.scenario.scenario import Scenario
from testbed.streams import stream


def check_trials(scenario: Scenario) -> None:
    """Refuse what a run would refuse before its first reading, by some poses that it would draw.

    Stations where no tracker can stand, and trials with too few poses.

    Raises
    ------
    InputError
        As `require_stations`, `require_ranges`, `Bench.check_views` and `require_poses`, or as a
        run says that there are no such poses.
    """
    if not scenario.trial:
        return
    bench = open_bench(scenario)
    here = not scenario.plan.stations.given  # else the plan looks for a place of its own
    if here:
        require_stations(bench)
    size = min(scenario.pool.size, PROBED_POSES)
    q = bench.candidates().draw(stream(scenario.seed, "pool"), size=size).q
    if here:
        require_ranges(bench, q, "the pool")
    if size == scenario.pool.size:  # else others may show what none of these does
        bench.check_views(q)
    require_poses(replace(bench, pool_q=q))


def require_poses(bench: Bench) -> None:
    """Refuse a trial with too few poses before anything is played: M27, and how many it needs."""
    rows = bench.equations
    most = max(
        bench.kept().n_free if mode == "whitened" else bench.free(mode).n_free
        for mode in bench.scenario.identification.estimators
    )
    tracker = bench.scenario.tracker
    missed = tracker.missed if isinstance(tracker, At960Tracker) else 0
    if bench.scenario.uncertainty.replications:
        missed *= 2  # they visit what was measured, and miss some again
    for trial in bench.scenario.trial:
        if rows * (trial.poses - missed) <= most:
            has = f"{rows * max(trial.poses - missed, 0)} equations for {most} parameters"
            message = f'[[trial]] "{trial.name}" poses is {trial.poses}: {has}'
            fix = f"write poses = {most // rows + 1 + missed} or more"
            raise refuse("trial.poses", trial.poses, code="M27", message=message, fix=fix)
