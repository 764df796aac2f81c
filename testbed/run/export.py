"""A campaign's virtual measurements as files that are read like real ones, bit for bit."""

import json
from pathlib import Path

import numpy as np

from calib.arrays import Array, Bool, Index
from calib.measurement.observations import POSE, Measurements, joined
from testbed.files.columns import covariance_names
from testbed.files.session_toml import SESSION_FILE
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory, validation_start
from testbed.robots.robot import Robot
from testbed.store.run_folder import whole_folder
from testbed.studies.trial.play import visits_of
from testbed.studies.trial.records import Campaign, Trial


def export_campaign(
    campaign: Campaign, robot: Robot, folder: str | Path, *, overwrite: bool = False
) -> None:
    """Write the measurements of every trial as a session folder.

    One CSV and one .toml per trial; the first trial's is session.toml, the others' are named after
    their trial. A trial keeps its first visits only: the later ones are made again from their
    streams, and the held-out poses are visited once, after them, marked as test.

    Parameters
    ----------
    campaign : Campaign
        As it was played.
    robot : Robot
        Its nominal robot.
    folder : path
        New, or an exported one that `overwrite` renames.
    overwrite : bool
        Rename what is there.

    Raises
    ------
    InputError
        The folder is in use. MachineError: the disk is full.
    """
    bench = open_laboratory(campaign.scenario, campaign.setting)
    with whole_folder(Path(folder), SESSION_FILE, overwrite=overwrite) as inside:
        for k, trial in enumerate(campaign.trials):
            table, is_test, time = exported_rows(bench, trial)
            rows = session_csv(robot, table, is_test, time)
            (inside / f"{trial.name}.csv").write_bytes(rows.encode())
            name = SESSION_FILE if k == 0 else f"{trial.name}.toml"
            text = _session_toml(campaign, robot, trial, table)
            (inside / name).write_bytes(text.encode())


def exported_rows(bench: Laboratory, trial: Trial) -> tuple[Measurements, Bool, Array]:
    """All visits of a trial's poses, then the held-out poses once.

    Returns
    -------
    table : Measurements
        Numbers of the held-out poses follow those of the pool.
    is_test : (m,) array of bool
        The held-out rows.
    time : (m,) array
        Of each shot since the campaign began [s].
    """
    scenario, setting = bench.scenario, bench.setting
    chosen, name = trial.selection.indices, trial.name
    span = len(chosen) * bench.tracker.pose_time
    visits = visits_of(bench, name, chosen)
    if not np.array_equal(visits[0].position, trial.measurements.position):
        raise RuntimeError(f"the visits of {name} could not be made again from their streams")
    ids = len(setting.pool_q) + np.arange(len(setting.test_q))
    start = validation_start(scenario)
    test = bench.measure(setting.test_q, ids, "export", "test", name, start=start)
    times = [_times(visit, chosen, k * span, bench) for k, visit in enumerate(visits)]
    times.append(_times(test, ids, start, bench))
    table = joined([trial.measurements, *visits[1:], test])
    is_test = np.arange(len(table)) >= len(table) - len(test)
    return table, is_test, np.concatenate(times)


def session_csv(robot: Robot, table: Measurements, is_test: Bool, time: Array) -> str:
    """The rows of a session as CSV in the project's own layout, 17 digits, SI units."""
    is_pose = bool(table.is_pose.all())
    units = ("m" if kind == "prismatic" else "rad" for kind in robot.model.chain.kinds)
    head = [
        "pose_id",
        "repeat",
        "split",
        "station",
        "time_s",
        *(f"q{j + 1}_{unit}" for j, unit in enumerate(units)),
        *("x_m", "y_m", "z_m"),
        *(f"r{i}{j}" for i in "123" for j in "123" if is_pose),
        *(f"reflector_{axis}_m" for axis in "xyz" if not is_pose),
        *covariance_names(),
    ]
    # the triangle that whitening reads: the two may differ in the last bit
    i, j = np.triu_indices(6)
    last = table.rotation.reshape(-1, 9) if is_pose else table.offset
    numbers = np.column_stack([time, table.q, table.position, last, table.covariance[:, j, i]])
    rows = [
        f"{pose},{repeat},{'test' if test else 'identify'},{station + 1},"
        + ",".join(f"{value:.17g}" for value in row)
        for pose, repeat, test, station, row in zip(
            table.pose_id, table.repeat, is_test, table.station, numbers, strict=True
        )
    ]
    return "\n".join([",".join(head), *rows, ""])


def _times(visit: Measurements, poses: Index, start: float, bench: Laboratory) -> Array:
    """When each row of a visit was measured [s]; missed shots took their time too."""
    at = {int(pose): k for k, pose in enumerate(poses)}
    turn = np.array([at[int(pose)] for pose in visit.pose_id], dtype=np.float64)
    return np.asarray(start + bench.tracker.pose_time * turn)


def _session_toml(campaign: Campaign, robot: Robot, trial: Trial, table: Measurements) -> str:
    """What the CSV does not say."""
    scenario = campaign.scenario
    wanted = scenario.identification
    free = wanted.free if isinstance(wanted.free, str) else list(wanted.free)
    kind = "frames" if table.kind[0] == POSE else "points"
    file = json.dumps(f"{trial.name}.csv", ensure_ascii=False)
    visits = scenario.uncertainty.repeats
    return "\n".join(
        [
            "# SIMULATED - measurements of a virtual robot by a virtual tracker",
            "format = 1",
            f"name = {json.dumps(f'{scenario.name} {trial.name}', ensure_ascii=False)}",
            f"robot = {json.dumps(robot.name, ensure_ascii=False)}",
            "simulated = true",
            "",
            "[joints]",
            f"file = {file}",
            'source = "commanded"',
            "",
            f"[{kind}]",
            f"file = {file}",
            "",
            "[uncertainty]",
            "# the 21 columns cov_... hold what the joints scatter, too",
            'joint_repeatability = "included"',
            "",
            "[identification]",
            'model = "geometric"',
            f"free = {json.dumps(free, ensure_ascii=False)}",
            f'base = "{wanted.base}"',
            f'tool = "{wanted.tool}"',
            f'visits = "first"  # of {visits}; the others show the repeatability',
            "",
        ]
    )
