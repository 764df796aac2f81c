"""Files of one reflector each: whose they are, and whether all of them are of one tool."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from calib.arrays import Array, evenly
from calib.geometry.model import RobotModel
from calib.measurement.accuracy import rotation_errors
from calib.measurement.observations import Measurements
from testbed.files.dialects.tables import PointsTable
from testbed.files.frames_fit import far_for, fit_frames, flange_poses
from testbed.files.readings import Readings
from testbed.files.reflectors.one_tool import NotOneTool, apart_or_alike
from testbed.files.refusal import refusal
from testbed.files.rows.shifts import FEWEST
from testbed.files.session import Session
from testbed.files.targets import TargetPart

Visit: TypeAlias = tuple[int, int, str]
"""Number of a pose, which visit of it, and the target where there are several."""
KEY = "points.reflector_files"
GIVES, NOISE = 1e-3, 5.0
"""How far reflectors on one tool may come from and to each other [m]: plates bend by less; or so
many standard deviations of their noise, where that is more."""
TURNS = 4.0
"""By so many times what their distance may vary would a reflector have to move on the tool, for it
to be said that it does not turn with it."""
FITTED = 300
"""Poses by which it is told how the base is turned."""
MOST = 20
"""Each file is held against so many before it: of 1000 files each against each took minutes."""
SHIFTS = (1, -1, 2, -2, 3, -3)
"""Rows by which the readings of one file may stand beside other poses than those of another."""


def of_reflector(readings: Readings, name: str, nests: Collection[str] = ()) -> Readings:
    """The readings of a file that is said to be of one reflector; those of `nests` stay theirs.

    Raises
    ------
    InputError
        S37: it names targets of its own.
    """
    own = sorted({*readings.target} - {"", name, *nests})
    if own:
        alone = len(own) == 1 and not {"", name} & {*readings.target}
        other = "another name" if len(own) == 1 else f"{len(own)} targets"
        raise refusal(
            readings.where, KEY, f'is the file of the reflector "{name}", and has {other} in its '
            f"column target: {', '.join(own[:4])}", code="S37", value=name,
            fix=f'call it {own[0]} under reflector_files' if alone else
            "name the file under [points] file, which reads several targets of one file; fixed "
            "points that were measured in between belong under [drift] nests",
        )  # fmt: skip
    target = tuple(one if one in nests else name for one in readings.target)
    return replace(readings, target=target)


def require_as_stated(
    session: Session, parts: Sequence[TargetPart], section: PointsTable, model: RobotModel
) -> None:
    """Refuse files of a reflector each that are none, and files of a station each that are those.

    Reflectors on one tool are as far from each other at every pose, whatever the robot is and in
    every frame that is the same for both, and turn about each other as the tool does.

    Raises
    ------
    InputError
        M31: files have no pose in common, or their rows stand beside each other's poses. M32: files
        of a reflector each are of one reflector, or of different frames; files of a station each
        are of several reflectors and one station.
    """
    own = [part for part in parts if part.section is section and len(part)]
    alone = bool(section.reflector_files)
    if len(own) < 2 or not (alone or len(section.files) > 1):
        return
    names = [part.readings.target[0] if alone else part.readings.where for part in own]
    at = {
        name: _visits(session, parts, part, alone=alone)
        for name, part in zip(names, own, strict=True)
    }
    where = {name: part.readings.where for name, part in zip(names, own, strict=True)}
    pairs = [_Pair.of(session.measurements, *two, at, model) for two in _near(names)]
    if alone:
        _require_a_pose_in_common(at, where)
        _require_one_tool(pairs, where)
    else:
        _require_stations(pairs)


@dataclass(frozen=True, slots=True)
class _Pair:
    """Readings of two files at the same visits of poses."""

    one: str
    other: str
    first: Array
    """(k, 3) of the one [m]."""
    second: Array
    """(k, 3) of the other [m]."""
    q: Array
    """(k, n) joints there [rad, m]."""
    model: RobotModel
    """Nominal."""
    far: float
    """By how much the noise of the readings and a tool that gives let their distance vary [m]."""

    @classmethod
    def of(
        cls,
        table: Measurements,
        one: str,
        other: str,
        at: Mapping[str, Mapping[Visit, int]],
        model: RobotModel,
    ) -> "_Pair":
        """Those of two files, from the rows of their visits."""
        both = [(row, at[other][key]) for key, row in at[one].items() if key in at[other]]
        first, second = np.array(both, dtype=np.int64).reshape(-1, 2).T
        u = np.einsum("mii->m", table.covariance[first, :3, :3]) / 3
        far = max(GIVES, NOISE * float(np.sqrt(2 * np.median(u)))) if len(u) else GIVES
        return cls(
            one, other, table.position[first], table.position[second], table.q[first], model, far
        )

    @property
    def is_moved(self) -> bool:
        """Whether the one stands beside the other as if its frame were moved, and not turned."""
        away = self.second - self.first
        return float(np.median(np.linalg.norm(away - np.median(away, axis=0), axis=1))) <= self.far

    def why(self) -> NotOneTool | None:
        """Why both are not of one tool and one frame; None if they may be."""
        why = apart_or_alike(self.first, self.second, self.far)
        if why is not None or len(self.first) < FEWEST or not self.is_moved:
            return why
        turned = self.turned_along
        if turned is None:
            return None
        return NotOneTool(
            "one point",
            "lie beside each other in one direction at all poses, though the tool turns by "
            f"{np.degrees(turned):.0f} deg: they are one point in two frames",
        )

    @property
    def turned_along(self) -> float | None:
        """How far the tool turns from its first pose, the median, if that moves the other on it.

        None where the other stays at one place of the tool all the same, as above the one on a
        tool that turns about the vertical alone; and where base and tool do not explain the one, so
        that it is not known how the tool is turned [rad].
        """
        some = evenly(np.arange(len(self.first)), FITTED)
        T, seen = flange_poses(self.model, self.q[some]), self.first[some]
        frames = fit_frames(T, seen, None, one_valley=True)
        if frames.misfit(T, seen, None).score > far_for(seen):
            return None
        away = (self.second[some] - seen)[:, None] @ frames.R @ T[:, :3, :3]
        wanders = np.linalg.norm(away - np.median(away, axis=0), axis=-1)
        if float(np.median(wanders)) <= TURNS * self.far:
            return None
        return float(np.median(rotation_errors(T, np.broadcast_to(T[0], T.shape))))

    @property
    def shift(self) -> int:
        """By how many rows the other must be taken to stay with the one; 0 if no such number."""
        m = len(self.first)
        for shift in SHIFTS:
            low, high = max(0, -shift), m - max(0, shift)
            first, second = self.first[low:high], self.second[low + shift : high + shift]
            if high - low > m // 2 and not apart_or_alike(first, second, self.far):
                return shift
        return 0


def _visits(
    session: Session, parts: Sequence[TargetPart], part: TargetPart, *, alone: bool
) -> dict[Visit, int]:
    """Row of the session of each visit of a pose in one of its files, by target if not `alone`."""
    start = sum(len(one) for one in parts[: parts.index(part)])
    table = session.measurements
    rows = range(start, start + len(part))
    targets = ("",) * len(part) if alone else part.readings.target
    return {
        (int(table.pose_id[k]), int(table.repeat[k]), target): k
        for k, target in zip(rows, targets, strict=True)
    }


def _near(names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Each file with the `MOST` before it, in the order of both."""
    for k, other in enumerate(names):
        yield from ((one, other) for one in names[max(0, k - MOST) : k])


def _require_a_pose_in_common(
    at: Mapping[str, Mapping[Visit, int]], where: Mapping[str, str]
) -> None:
    """Refuse a file none of whose poses is one of another reflector's."""
    often = Counter(visit for visits in at.values() for visit in visits)
    for name, visits in at.items():
        if all(often[visit] == 1 for visit in visits):
            raise refusal(
                where[name], KEY, f'no pose of "{name}" is one of the other reflectors\'',
                code="M31", allowed="each file has one reflector at the poses of the others",
                fix="correct the column pose_id, or the joints, by which poses are told",
            )  # fmt: skip


def _require_one_tool(pairs: Sequence[_Pair], where: Mapping[str, str]) -> None:
    """Refuse files of a reflector each that are not of one tool before one station."""
    wrong = [(pair, why) for pair in pairs if (why := pair.why()) is not None]
    if not wrong:
        return
    # of three files the one that fits none is to be named
    often = Counter(name for pair, _ in wrong for name in (pair.one, pair.other))
    odd = max([*where][::-1], key=lambda name: often[name])
    pair, why = next((pair, why) for pair, why in wrong if odd in (pair.one, pair.other))
    said = f'"{pair.one}" and "{pair.other}" {why.words}'
    if why.kind == "one point":
        raise refusal(
            where[odd], KEY, said, code="M32", allowed="each reflector has a file of its own",
            fix="if two stations measured it, write files = [...] in place of reflector_files",
        )  # fmt: skip
    if why.kind == "one reflector":
        raise refusal(
            where[odd], KEY, said, code="M32", allowed="each reflector has a file of its own",
            fix="one reflector was exported twice: take one of the two files out, or, if two "
            "stations measured it, write files = [...] in place of reflector_files",
        )  # fmt: skip
    if shift := pair.shift:
        many = "one row" if abs(shift) == 1 else f"{abs(shift)} rows"
        raise refusal(
            where[odd], KEY, f'{said}, and they do if the readings of "{pair.other}" are taken '
            f"{many} further {'down' if shift > 0 else 'up'}", code="M31",
            allowed="row k of each file is one pose, where no pose_id tells it",
            fix="add the missing row, or take the extra one out, or number poses in pose_id",
        )  # fmt: skip
    raise refusal(
        where[odd], KEY,
        f"{said}: the files are in different frames or units, or their rows are of different poses",
        code="M32", allowed="reflectors on one tool, in the frame of one station",
        fix="export all of them in one frame, with the poses in one order or named in pose_id; if "
        "each is of a station of its own, write files = [...] in place of reflector_files",
    )  # fmt: skip


def _require_stations(pairs: Sequence[_Pair]) -> None:
    """Refuse files of a station each whose points are those of several reflectors in one frame."""
    for pair in pairs:
        if len(pair.first) >= FEWEST and not pair.is_moved and pair.why() is None:
            raise refusal(
                pair.other, "points.files",
                f"its points stay as far from those of {pair.one} at all poses, as two reflectors "
                "on one tool do, and not as one reflector that two stations see", code="M32",
                allowed="files = [...] has one file for each station",
                fix="write reflector_files = { NAME = FILE, ... } under [points] in its place",
            )  # fmt: skip
