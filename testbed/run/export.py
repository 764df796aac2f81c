"""A campaign's virtual measurements as files that are read like real ones, bit for bit."""

from pathlib import Path

import numpy as np

from calib.arrays import Array, Bool, Index, Labels
from calib.measurement.observations import Measurements, joined
from calib.uncertainty.statement.conditions import Conditions
from testbed.files.columns import covariance_names
from testbed.files.conditions import CENTERS, COLUMNS
from testbed.files.session_toml import SESSION_FILE
from testbed.laboratory.truth.laboratory import Laboratory, open_laboratory
from testbed.laboratory.truth.setting import validation_start
from testbed.report.text import csv_text
from testbed.robots.file_frames import stated_at_flange
from testbed.robots.robot import Robot
from testbed.run.export_toml import session_toml
from testbed.scenario.fixtures import RANGES
from testbed.store.whole_folder import whole_folder
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
            names = targets_in(bench, table)
            conditions = conditions_in(bench, table, time)
            for file, rows in _files(trial, table).items():
                part = names[rows] if names is not None else None
                under = conditions.rows(rows)
                text = session_csv(robot, table.rows(rows), is_test[rows], time[rows], part, under)
                (inside / file).write_bytes(text.encode())
            name = SESSION_FILE if k == 0 else f"{trial.name}.toml"
            text = session_toml(bench, trial, table)
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
    span = bench.visit_time(len(chosen))
    visits = visits_of(bench, name, chosen)
    if not np.array_equal(visits[0].position, trial.measurements.position):
        raise RuntimeError(f"the visits of {name} could not be made again from their streams")
    ids = len(setting.pool_q) + np.arange(len(setting.test_q))
    start = validation_start(scenario)
    test = bench.measure(setting.test_q, ids, "export", "test", name, start=start, distances=False)
    times = [_times(visit, chosen, k * span, bench) for k, visit in enumerate(visits)]
    times.append(_times(test, ids, start, bench))
    table = joined([trial.measurements, *visits[1:], test])
    is_test = np.arange(len(table)) >= len(table) - len(test)
    return table, is_test, np.concatenate(times)


def targets_in(bench: Laboratory, table: Measurements) -> Labels | None:
    """Name (m,) of the target of each row, with the place it was seen from; None without rounds."""
    if not bench.rounds:
        return None
    names = np.empty((len(table), 2), dtype="<U64")
    for one in bench.rounds:
        names[one.rows_in(table)] = one.target, one.place
    return names


def conditions_in(bench: Laboratory, table: Measurements, time: Array) -> Conditions:
    """What hung on the arm at m rows, and how warm it was at their times (m,) [s].

    None of what does not matter to this arm.
    """
    truth, terms, payload = bench.scenario.truth, bench.truth.unmodelled, table.conditions.payload
    if payload is None and terms.springs is not None:
        payload = np.full(len(time), truth.payload_kg)
    center = None
    if payload is not None and terms.springs is not None:
        hung = stated_at_flange(bench.robot, terms.springs.payload_center)
        center = np.tile(hung, (len(time), 1))
    warmth = terms.thermal.temperature(time) if terms.thermal is not None else None
    return Conditions(payload, None, warmth, center)


def _files(trial: Trial, table: Measurements) -> dict[str, Index]:
    """The files of a trial and their rows: what the tracker saw, and distances."""
    far = table.is_distance
    files = {f"{trial.name}.csv": np.flatnonzero(~far)}
    return files | ({f"{trial.name}{RANGES}.csv": np.flatnonzero(far)} if far.any() else {})


def session_csv(
    robot: Robot,
    table: Measurements,
    is_test: Bool,
    time: Array,
    names: Labels | None = None,
    conditions: Conditions | None = None,
) -> str:
    """The rows of a session as CSV in the project's own layout, 17 digits, SI units.

    All rows are of one kind; `names` (m, 2) are the target of each and where it was seen from,
    `conditions` what is known of payload and temperature.
    """
    is_pose, far = bool(table.is_pose.all()), bool(table.is_distance.all())
    kinds = robot.model.chain.kinds
    own = robot.controller.counted(len(kinds))
    head = [
        "pose_id",
        "repeat",
        "split",
        "anchor" if far else "station",
        *(["target"] if names is not None and not is_pose else []),
        "time_s",
        *(f"q{j + 1}_{'m' if kinds[j] == 'prismatic' else 'rad'}" for j in own),
        *(["distance_m"] if far else ["x_m", "y_m", "z_m"]),
        *(f"r{i}{j}" for i in "123" for j in "123" if is_pose),
        *(f"reflector_{axis}_m" for axis in "xyz" if not is_pose and names is None),
        *covariance_names(),
    ]
    under = conditions or Conditions()
    said = [getattr(under, kind) for kind in under.stated]
    head += [COLUMNS[kind] for kind in under.stated]
    if under.center is not None:
        said += list(under.center.T)
        head += [f"{stem}_m" for stem in CENTERS]
    # the triangle that whitening reads: the two may differ in the last bit
    i, j = np.triu_indices(6)
    seen = table.distance[:, None] if far else table.position
    last = table.rotation.reshape(-1, 9) if is_pose else table.offset
    if names is not None and not is_pose:
        last = last[:, :0]
    joints = robot.controller.written(table.q)
    numbers = np.column_stack([time, joints, seen, last, table.covariance[:, j, i], *said])
    places = [[str(station + 1)] for station in table.station]
    if names is not None and not is_pose:
        at = names[:, 1] if far else [place for (place,) in places]
        places = [[str(place), str(target)] for place, target in zip(at, names[:, 0], strict=True)]
    rows = (
        [str(pose), str(repeat), "test" if test else "identify", *place]
        + [f"{value:.17g}" for value in row]
        for pose, repeat, test, place, row in zip(
            table.pose_id, table.repeat, is_test, places, numbers, strict=True
        )
    )
    return csv_text(head, rows)


def _times(visit: Measurements, poses: Index, start: float, bench: Laboratory) -> Array:
    """When each row of a visit was measured [s]; missed shots took their time too."""
    at = {int(pose): k for k, pose in enumerate(poses)}
    turn = np.array([at[int(pose)] for pose in visit.pose_id], dtype=np.float64)
    for k, one in enumerate(bench.rounds):
        turn[one.rows_in(visit)] += k * len(poses)
    return np.asarray(start + bench.tracker.pose_time * turn)
