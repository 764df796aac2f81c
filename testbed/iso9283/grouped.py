"""Rows into poses and paths that were run equally often, or a sentence on what does not fit."""

from collections.abc import Mapping, Sequence

import numpy as np

from calib.arrays import Array, Index, frozen
from calib.errors import InputError
from calib.measurement.cycles import FEWEST
from testbed.files.matching import visits_of
from testbed.files.refusal import refusal
from testbed.iso9283.records import PATH_CYCLES, POSE_CYCLES, PathRuns, Visits
from testbed.iso9283.rows import Rows, are_counts, one_command, require_pose_names
from testbed.units import counted, listed

MOST_NAMED = 5
EACH = " of each direction of approach"
"""Which cycles are meant, where the numbers of the file go on from one direction to the next."""
MOST_POINTS = 5000
"""Planes across a path: each is held against every reading of a run."""
Key = tuple[str, ...]
Commands = Mapping[Key, tuple[Array, Array | None]]
"""Commanded position and rotation by the name of a pose, or by path and point."""
NO_COMMAND = (
    'write columns command_x_mm command_y_mm command_z_mm (also _m), or commanded = "FILE" under '
    "[{}] in session.toml, a table of them by {}"
)


def visits_in(rows: Rows, commands: Commands, *, drop: bool) -> tuple[Visits, tuple[str, ...]]:
    """Poses with all their cycles, and notes on those that were left out.

    Parameters
    ----------
    rows : Rows
        Of poses only.
    commands : mapping
        By (pose,), where the rows do not say them.
    drop : bool
        Leave out cycles that are not whole, instead of refusing.

    Raises
    ------
    InputError
        M25 no name; M27 too few cycles; M31 a cycle twice, missing, or another command; M35 no
        command, time that goes back.
    """
    require_pose_names(rows)
    keys = list(zip(rows.pose, rows.approach, strict=True))
    entries = list(dict.fromkeys(keys))
    number = {key: k for k, key in enumerate(entries)}
    entry = np.array([number[key] for key in keys])
    names = [f"pose {pose}" + (f" from {way}" if way else "") for pose, way in entries]
    cycle = visits_of(entry.tolist()) if rows.cycle is None else rows.cycle
    each = ""
    if rows.cycle is not None:
        cycle = _by_approach(cycle, rows.approach)
        each = EACH if cycle is not rows.cycle else ""
    table, notes = _whole(rows, entry, cycle, names, POSE_CYCLES, drop=drop, each=each)
    _check_times(rows, table, names)
    sent = [
        _command(rows, table[k], (entries[k][0],), commands, names[k]) for k in range(len(names))
    ]
    turned = rows.rotation is not None
    turns = [R for _, R in sent if R is not None]
    if turned and len(turns) < len(sent):
        said = "nothing states how the tool was commanded to stand, so that orientation has no AP"
        turns, notes = [], (*notes, f"{rows.where}: {said}")
    noise = None if rows.covariance is None else rows.covariance[table].mean(axis=1)
    return (
        Visits(
            pose=tuple(pose for pose, _ in entries),
            approach=tuple(way for _, way in entries),
            command=frozen(np.array([place for place, _ in sent])),
            position=frozen(rows.position[table]),
            command_rotation=frozen(np.array(turns)) if turned and turns else None,
            rotation=None if rows.rotation is None else frozen(rows.rotation[table]),
            noise=None if noise is None else frozen(noise[:, :3, :3]),
            turn_noise=frozen(noise[:, 3:, 3:]) if noise is not None and turned else None,
            time=None if rows.time is None else frozen(rows.time[table]),
            number=None if rows.cycle is None else rows.cycle[table],
        ),
        notes,
    )


def paths_in(
    rows: Rows, commands: Commands, *, drop: bool
) -> tuple[tuple[PathRuns, ...], tuple[str, ...]]:
    """Paths with all their runs, and notes on those that were left out; raises as `visits_in`."""
    found, notes = list[PathRuns](), list[str]()
    for name in dict.fromkeys(rows.path):
        own = rows.rows(np.flatnonzero([path == name for path in rows.path]))
        made, said = _path(name, own, commands, drop=drop)
        found.append(made)
        notes += said
    if rows.rotation is not None:
        notes.append(
            f"{rows.where}: rotations along paths are not judged: AT and RT are of positions"
        )
    return tuple(found), tuple(notes)


def _path(
    name: str, rows: Rows, commands: Commands, *, drop: bool
) -> tuple[PathRuns, tuple[str, ...]]:
    """One path with its runs: point by point, or as many readings as there are."""
    called = f"path {name}"
    noise = None if rows.covariance is None else rows.covariance[:, :3, :3].mean(axis=0)
    if rows.point is None or np.isnan(rows.point).all():
        return _sampled(name, rows, commands, noise), ()
    wrong = ~are_counts(rows.point)
    if wrong.any():
        place, fix = rows.place[int(np.argmax(wrong))], "number the points of the path"
        message = f"path_point of {called} is not a whole number"
        raise refusal(place, "path_point", message, code="M25", fix=fix)
    numbers, entry = np.unique(rows.point.astype(np.int64), return_inverse=True)
    names = [f"point {k} of {called}" for k in numbers]
    cycle = visits_of(entry.tolist()) if rows.cycle is None else rows.cycle
    table, notes = _whole(rows, entry, cycle, names, PATH_CYCLES, drop=drop)
    _check_times(rows, table.T, [f"cycle {cycle[k]} of {called}" for k in table[0]])
    if len(numbers) < 2:
        message, fix = f"{called} has one point", "give two or more"
        raise refusal(rows.place[0], "path_point", message, code="M27", fix=fix)
    sent = [
        _command(rows, table[k], (name, str(point)), commands, names[k])[0]
        for k, point in enumerate(numbers)
    ]
    _require_steps(called, numbers.tolist(), sent, rows.place[table[0, 0]])
    runs = tuple(frozen(rows.position[table[:, k]]) for k in range(table.shape[1]))
    begins = tuple(rows.place[k] for k in table[0])
    points = tuple(str(point) for point in numbers)
    return PathRuns(name, points, frozen(np.array(sent)), runs, begins, True, noise), notes


def _sampled(name: str, rows: Rows, commands: Commands, noise: Array | None) -> PathRuns:
    """A path whose readings have no numbers: each run in the order of its rows."""
    own = {key[1]: place for key, (place, _) in commands.items() if key[:1] == (name,)}
    if len(own) < 2:
        raise _no_command(rows.place[0], f"path {name}", "paths", "path and path_point")
    if rows.cycle is None:
        message, fix = f"no column says the cycle of path {name}", "number its runs in cycle"
        raise refusal(rows.place[0], "cycle", message, fix=fix)
    cycles = np.unique(rows.cycle)
    _require_cycles(len(cycles), f"path {name}", rows.place[0], PATH_CYCLES)
    index = [np.flatnonzero(rows.cycle == cycle) for cycle in cycles]
    for cycle, one in zip(cycles, index, strict=True):
        _check_times(rows, one[None], [f"cycle {cycle} of path {name}"])
    points = sorted(own, key=int)
    _require_steps(f"path {name}", points, [own[point] for point in points], rows.place[0])
    return PathRuns(
        name, tuple(points), frozen(np.array([own[point] for point in points])),
        tuple(frozen(rows.position[one]) for one in index),
        tuple(rows.place[one[0]] for one in index), False, noise,
    )  # fmt: skip


def _by_approach(cycle: Index, approach: Sequence[str]) -> Index:
    """Cycles counted for each direction of approach where their numbers go on through all."""
    ways, which = np.unique(np.array(approach, dtype=str), return_inverse=True)
    parts = [np.unique(cycle[which == k]) for k in range(len(ways))]
    if len(ways) < 2 or len(np.unique(np.concatenate(parts))) < sum(map(len, parts)):
        return cycle
    nth = [np.searchsorted(parts[k], one) for k, one in zip(which, cycle, strict=True)]
    return np.array(nth) + 1


def _require_steps(
    called: str, points: Sequence[object], sent: Sequence[Array], place: str
) -> None:
    """Refuse two points after each other that are commanded to one place, M31; too many, M36."""
    if len(points) > MOST_POINTS:
        message = f"{called} has {len(points)} commanded points"
        allowed = f"at most {MOST_POINTS}; its runs may have more readings"
        fix = "take every second point, or fewer"
        raise refusal(place, "path_point", message, allowed=allowed, code="M36", fix=fix)
    for k in range(1, len(points)):
        if not np.linalg.norm(sent[k] - sent[k - 1]) > 0:
            both = f"{points[k - 1]} and {points[k]}"
            message = f"points {both} of {called} are commanded to one place"
            fix = "a pause of the program is not a point: take one of them out"
            raise refusal(place, "path_point", message, code="M31", fix=fix)


def _whole(
    rows: Rows, entry: Index, cycle: Index, names: Sequence[str], wanted: int,
    *, drop: bool, each: str = "",
) -> tuple[Index, tuple[str, ...]]:  # fmt: skip
    """Row (e, n) of each entry in each cycle, and a note on cycles that were left out."""
    place: dict[tuple[int, int], int] = {}
    for row, key in enumerate(zip(entry.tolist(), cycle.tolist(), strict=True)):
        if key in place:
            line = rows.place[place[key]].rpartition(":")[2]
            message = f"{names[key[0]]}, cycle {key[1]} appears twice, first in line {line}"
            fix = "number the cycles 1, 2, 3 ... in the column cycle"
            raise refusal(rows.place[row], "cycle", message, code="M31", fix=fix)
        place[key] = row
    every = sorted({one for _, one in place})
    counts = np.bincount(entry, minlength=len(names))
    first = rows.place[0]
    _require_cycles(int(counts.max()), names[0], first, wanted, all_of_them=True)
    if (alone := np.flatnonzero(counts < FEWEST)).size:
        k = int(alone[0])
        times = "once" if counts[k] == 1 else f"{counts[k]} times"
        message = f"{names[k]} was measured {times}, others {counted(int(counts.max()), 'time')}"
        fix = "measure it in every cycle, or take its rows out"
        where = rows.place[int(np.argmax(entry == k))]
        raise refusal(where, "cycle", message, code="M31", fix=fix)
    whole = [one for one in every if all((k, one) in place for k in range(len(names)))]
    if len(whole) < len(every) and not drop:
        one = next(one for one in every if one not in whole)
        missing = [names[k] for k in range(len(names)) if (k, one) not in place]
        more = len(every) - len(whole) - 1
        said = f"cycle {one}{each} has no reading of {listed(missing, MOST_NAMED)}"
        be = "is" if more == 1 else "are"
        said += f", and {counted(more, 'more cycle')} {be} not whole either" * bool(more)
        fix = "measure it, or add --drop-invalid to leave such cycles out"
        raise refusal(
            rows.where, "cycle", said, code="M31", fix=fix,
            allowed="every cycle has every pose, and every point of its path",
        )  # fmt: skip
    _require_cycles(len(whole), names[0], first, wanted, all_of_them=True)
    table = np.array([[place[k, one] for one in whole] for k in range(len(names))])
    left = [str(one) for one in every if one not in whole]
    shown = ", ".join(left[:20])
    note = f"{rows.where}: cycles{each} that are not whole were left out: {shown}"
    return table, (note,) if left else ()


def _require_cycles(
    count: int, name: str, place: str, wanted: int, *, all_of_them: bool = False
) -> None:
    """Refuse what was not repeated; M27."""
    if count >= FEWEST:
        return
    subject = "everything" if all_of_them else name
    times = "once" if count == 1 else f"{count} times, in whole cycles"
    raise refusal(
        place, "cycle", f"{subject} was measured {times}: nothing shows how well it repeats",
        code="M27", value=count, allowed=f"at least {FEWEST} cycles; ISO 9283 asks for {wanted}",
        fix="measure more cycles, or name them in the column cycle",
    )  # fmt: skip


def _check_times(rows: Rows, table: Index, names: Sequence[str]) -> None:
    """Refuse times that go back from one cycle, or one point, to the next; M35."""
    if rows.time is None:
        return
    for index, name in zip(table, names, strict=True):
        back = np.flatnonzero(np.diff(rows.time[index]) < 0)
        if back.size:
            row, before = index[back[0] + 1], index[back[0]]
            line = rows.place[before].rpartition(":")[2]
            gone = rows.time[before] - rows.time[row]
            message = f"the time of {name} goes back by {gone:.6g} s after line {line}"
            fix = "correct the numbers of the cycles, or the times; or take the column of times out"
            raise refusal(rows.place[row], "time", message, fix=fix)


def _command(
    rows: Rows, index: Index, key: Key, commands: Commands, name: str
) -> tuple[Array, Array | None]:
    """Where a pose, or a point of a path, was commanded to be."""
    place = [rows.place[k] for k in index]
    if rows.command is not None:
        R = rows.command_rotation
        turned = None if R is None else one_command(name, R[index], place)
        return one_command(name, rows.command[index], place), turned
    if key not in commands:
        section, by = ("cycles", "pose_id") if len(key) == 1 else ("paths", "path and path_point")
        raise _no_command(place[0], name, section, by)
    return commands[key]


def _no_command(place: str, name: str, section: str, by: str) -> InputError:
    """The error where nothing says where the robot was sent."""
    message, fix = f"nothing states where {name} is commanded to be", NO_COMMAND.format(section, by)
    return refusal(place, "command_x_mm", message, fix=fix)
