"""What is said of a corrected program: its errors, columns not used, conditions nobody knows."""

from collections.abc import Mapping, Sequence

from calib.arrays import Array, Bool
from calib.uncertainty.statement.conditions import CENTER
from calib.uncertainty.statement.departure import Departure
from testbed.files.columns import misspelling
from testbed.files.conditions import CENTERS, COLUMNS
from testbed.files.joints import joint_columns
from testbed.files.rows.targets import NAMES, called
from testbed.files.table import Columns, DataTable, together
from testbed.robots.file_frames import base_words, of_toml_words
from testbed.robots.robot import IDENTIFIED, Robot
from testbed.units import counted, listed, significant

LEFT: Mapping[str, str] = {
    "singular": "left as written: the posture is nearly singular, and its correction would move a "
    "joint far; move the target",
    "limits": "left as written: the posture is outside the joint limits, as it is written or "
    "corrected",
    "out of reach": "left as written: the robot does not reach it from a posture near this one, as "
    "where the arm is stretched or axes of the wrist are in line; move the target",
}
"""Why a target is not corrected."""
LEAST_MM = 1e-3
"""Smaller remaining errors are not said [mm]."""
MOST_NAMED, LONGEST = 10, 40
"""Targets and columns named in one sentence, and letters of one of them."""


def outcome_words(corrected: Bool, before: Array, left: Array, names: Sequence[str]) -> str:
    """How many targets are corrected and what errors these have [m]; which others there are.

    What a target out of reach misses is no error of the robot: it has no part in the means.
    """
    count, changed = len(corrected), int(corrected.sum())
    kept = [name for name, done in zip(called(names), corrected, strict=True) if not done]
    shown = listed(kept, MOST_NAMED)
    targets = "target" + "s" * (len(kept) > 1)
    aside = f"; {len(kept)} left as written ({targets} {shown})" if kept else ""
    text = f"{changed} of {counted(count, 'target')} corrected{aside}"
    if not changed:
        return text
    after = 1e3 * float(left[corrected].mean())
    all_of_them = {1: "it", 2: "both"}.get(count, f"all {count}")
    whose = all_of_them if changed == count else f"the {changed} corrected"
    still = f" and by {significant(after)} mm as corrected" if after >= LEAST_MM else ""
    return (
        f"{text}: by the identified model, the tool misses {whose} by "
        f"{1e3 * before[corrected].mean():.3f} mm on average as written{still}"
    )


def frame_words(robot: Robot) -> tuple[str, ...]:
    """In which frame the poses of a program stand, where its robot comes from a URDF or MJCF."""
    base = base_words(robot) or of_toml_words(robot)
    return (f"the poses of the program are taken as those of the tool in {base}",) if base else ()


def controller_words(robot: Robot) -> tuple[str, ...]:
    """For which controller a program is corrected, if the robot's links were identified before."""
    if not robot.sources.get("geometry", "").startswith(IDENTIFIED):
        return ()
    return (
        f"the numbers of {robot.name} were identified before, as its file says: the program is "
        "corrected for a controller that computes with these, and the radii hold for none other; "
        "if yours has its maker's numbers, give the robot as its maker describes it, and the "
        "measurements from which it was identified",
    )


def unused_words(table: DataTable, robot: Robot, targets: Columns) -> tuple[str, ...]:
    """A sentence on columns that nothing is taken from; none if there are none.

    `targets` are the columns of the targets themselves.
    """
    joints = joint_columns(table, robot)
    names = next(((name,) for name in NAMES if name in table), ())
    angles = any(name.startswith(("rx_", "e1_")) for name in targets.names)
    own = together(targets, joints, table.find("length", *CENTERS)).names
    read = {*own, *names, *COLUMNS.values(), *(("euler",) if angles else ())}
    taken = {theirs for name, theirs in table.names.items() if name in read}
    unused = [name for name in table.sheet.head if name not in taken]
    if not unused:
        return ()
    shown = listed([name[:LONGEST] for name in unused], MOST_NAMED)
    hint = misspelling(name for name in unused if name in table.names)
    return (
        f"not used, and left as they are: the program's column{'s' * (len(unused) > 1)} {shown}"
        + f"; {hint}" * bool(hint),
    )


def unknown_words(away: Departure) -> tuple[str, ...]:
    """What to do where targets state what the measurements do not, and what load they are for."""
    if not away.unknown:
        return ()
    keys = " and ".join(COLUMNS.get(kind, "payload_center_mm") for kind in away.unknown)
    fix = f"to get a region there, write {keys} under [conditions] in session.toml"
    if CENTER in away.unknown:
        return (
            "these targets are corrected for a payload that hangs where it did in the "
            "measurements, wherever that was, and not where they say",
            fix,
        )
    if "payload" not in away.unknown:
        return (fix,)
    return (
        "all targets are corrected for what the arm carried in the measurements, whatever it was, "
        f"and not for the {away.targets.words('payload')} that they state",
        fix,
    )
