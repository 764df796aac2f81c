"""Every message on a measurement file, word for word: one case or more per row of bad input."""

import gzip
import json
import zipfile
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from calib.errors import CalibError
from calib.geometry.gravity import weight_of
from calib.geometry.parameters import parameters_of
from calib.identification.identify import identify
from calib.identification.row_ladders import row_ladders
from calib.identification.start.start import start_frames
from testbed.files.columns import covariance_names
from testbed.files.probe import probe
from testbed.files.programs.read import read_program
from testbed.files.read import ReadOptions, read_held_out, read_session
from testbed.files.rows.terms import row_terms
from tests.golden.words import assert_as_written
from tests.hangs import no_hang
from tests.testbed.files.made import ROBOT, Made, N, columns, csv, made, with_spread

SIGMAS = "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\n"


def table(**changes):
    """Full poses of 29 rows with all that the layout asks for."""
    return with_spread(columns(made())) | {"euler": ["XYZ"] * 29} | changes


SIGMA_COLUMNS = ("ux_mm", "uy_mm", "uz_mm", "urx_deg", "ury_deg", "urz_deg")


def without(*names, **changes):
    return {k: v for k, v in table(**changes).items() if k not in names}


def ranged(**changes):
    """Distances from one anchor."""
    own = {"distance_mm": [1.0] * 29, "anchor": ["A"] * 29, "u_distance_mm": [0.1] * 29}
    return without("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg", "euler") | own | changes


def wrong(name, row, value):
    """One cell that is another text."""
    own = [f"{v:.9g}" if not isinstance(v, str) else v for v in table()[name]]
    own[row] = value
    return table(**{name: own})


def read(content, config=None, *, probed=False, **options):
    """Read a CSV, by a session.toml if there is one, and try other readings."""

    def case(folder):
        text = csv(content) if isinstance(content, dict) else content
        (folder / "a.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
        if config is not None:
            (folder / "s.toml").write_text(config)
        toml = None if config is None else folder / "s.toml"
        session = read_session(folder / "a.csv", ROBOT, config=toml, options=ReadOptions(**options))
        if probed:
            probe(ROBOT, session).raise_if_wrong()
        return session

    return case


def apart(joints, frames, config=""):
    """Joints and frames in two files."""

    def case(folder):
        (folder / "joints.csv").write_text(csv(joints))
        (folder / "frames.csv").write_text(csv(frames))
        (folder / "session.toml").write_text(
            f'{config}\n[joints]\nfile = "joints.csv"\n[frames]\nfile = "frames.csv"\n'
        )
        return read_session(folder, ROBOT)

    return case


def stations(*seen):
    """One set of joints seen from several stations."""

    def case(folder):
        (folder / "joints.csv").write_text(csv(JOINTS))
        names = [f"{k + 1}.csv" for k in range(len(seen))]
        for name, content in zip(names, seen, strict=True):
            (folder / name).write_text(csv(content))
        files = ", ".join(f'"{name}"' for name in names)
        (folder / "session.toml").write_text(
            f'[joints]\nfile = "joints.csv"\n[frames]\nfiles = [{files}]\n'
        )
        return read_session(folder, ROBOT)

    return case


def visits(config, **files):
    """Several sessions of one robot, all of the same rows unless a file has its own."""

    def case(folder):
        for name in ("a", "b"):
            (folder / f"{name}.csv").write_text(csv(files.get(name, table())))
        (folder / "session.toml").write_text(config)
        return read_session(folder, ROBOT)

    return case


A, B = ('[[session]]\nname = "a"\nfile = "a.csv"\n', '[[session]]\nname = "b"\nfile = "b.csv"\n')


def held_out(config):
    """Frames of held-out poses without joints, beside a session that names its files."""

    def case(folder):
        (folder / "session.toml").write_text(config)
        (folder / "test.csv").write_text(csv(SEEN))
        return read_held_out(folder / "test.csv", ROBOT, folder)

    return case


def program(**conditions):
    """A program of two targets, and what stands beside them."""

    def case(folder):
        targets = {f"q{j + 1}_deg": np.degrees(made().q[:2, j]) for j in range(N)}
        (folder / "p.csv").write_text(csv(targets | conditions))
        return read_program(folder / "p.csv", ROBOT)

    return case


def cartesian(**columns):
    """A program of two poses of the tool."""

    def case(folder):
        targets = {k: v[:2] for k, v in table().items() if k[0] in "xyzr"}
        (folder / "p.csv").write_text(csv(targets | columns))
        return read_program(folder / "p.csv", ROBOT)

    return case


JOINTS = {k: v for k, v in table().items() if k[0] in "pq"}
SEEN = {k: v for k, v in table().items() if k[0] != "q"}


def some(content, rows):
    return {k: np.asarray(v)[rows].tolist() for k, v in content.items()}


def identified(data):
    """Read and identify everything."""

    def case(folder):
        session = read(with_spread(columns(data)) | {"euler": ["XYZ"] * len(data.q)})(folder)
        start = start_frames(ROBOT.model, session.measurements)
        return identify(start.model, session.measurements, parameters_of(start.model))

    return case


def frozen_joint(data, joint):
    q = data.q.copy()
    q[:, joint] = 0.3
    return Made(q, data.truth.poses(q), data.truth)


def archive(content, path="x.bin"):
    """An archive with one file in it."""

    def case(folder):
        with zipfile.ZipFile(folder / "a.csv", "w") as file:
            file.writestr(path, content)
        return read_session(folder / "a.csv", ROBOT)

    return case


def packed(folder):
    with gzip.open(folder / "a.csv", "wb") as file:
        file.write(b"0" * 10_000_000)
    return read_session(folder / "a.csv", ROBOT)


def rapid(*lines):
    """Joints from a program."""

    def case(folder):
        (folder / "cal.mod").write_text("\n".join(lines))
        (folder / "frames.csv").write_text(csv(SEEN))
        (folder / "session.toml").write_text(
            '[joints]\nfile = "cal.mod"\nformat = "rapid"\n[frames]\nfile = "frames.csv"\n'
        )
        return read_session(folder, ROBOT)

    return case


def slipped(rows):
    """Readings of some poses at the first joints."""
    seen = {k: np.asarray(v)[rows] for k, v in table().items() if k[0] in "xyzr"}
    seen["x_mm"] = seen["x_mm"] + 1e-3 * np.arange(len(rows))  # no digits come twice
    return read(some(table(), np.arange(len(rows))) | seen)


def points(content, nests='["B1", "B2", "B3"]'):
    return read(content, f"[points]\n[drift]\nnests = {nests}\n[uncertainty]\nposition_um = 9\n")


def sa(content, keys=""):
    def case(folder):
        (folder / "smr.txt").write_text(content)
        (folder / "joints.csv").write_text(csv(JOINTS))
        (folder / "session.toml").write_text(
            '[joints]\nfile = "joints.csv"\n'
            f'[points]\nfile = "smr.txt"\nformat = "sa"\n{keys}\n{SIGMAS}'
        )
        return read_session(folder, ROBOT)

    return case


def sa_frames(content, keys):
    def case(folder):
        (folder / "frames.txt").write_text(content)
        (folder / "session.toml").write_text(
            f'[frames]\nfile = "frames.txt"\nformat = "sa"\nlength = "mm"\n{keys}\n{SIGMAS}'
        )
        return read_session(folder, ROBOT)

    return case


def records(rows):
    """Records in JSON."""

    def case(folder):
        (folder / "a.json").write_text(json.dumps(rows))
        return read_session(folder / "a.json", ROBOT)

    return case


def inside(count):
    """A number in so many objects."""
    return {"x": inside(count - 1)} if count else 1.0


R = {f"r{i + 1}{j + 1}": made().T[:, i, j] for i in range(3) for j in range(3)}
MATRIX = {k: v for k, v in table().items() if not k.startswith("r") and k != "euler"} | R
QUATERNION = with_spread(columns(made(), form="quaternion"))
RADIANS = {f"q{j + 1}_rad": np.degrees(made().q[:, j]) for j in range(N)}
NO_JOINTS = {k: v for k, v in table().items() if k[0] != "q"}
READ = {f"q{j + 1}_read_deg": np.degrees(made().q[:, j]) for j in range(N)}
TEXT = csv(table())


def systematic(*lines, kind="frames"):
    """A session.toml of readings of a kind with systematic parts."""
    return f"[{kind}]\n[uncertainty.systematic]\n" + "\n".join(lines) + "\n"


CASES = {
    "M20 degrees as radians": read(NO_JOINTS | RADIANS),
    "M20 radians as degrees": read(
        table(**{f"q{j + 1}_deg": made().q[:, j] for j in range(N)}), probed=True
    ),
    "M20 a joint turns the other way": read(
        table(q5_deg=-np.degrees(made().q[:, 4])), probed=True
    ),
    "M21 mm as m": read(
        without("x_mm", "y_mm", "z_mm", **{f"{a}_m": table()[f"{a}_mm"] for a in "xyz"}),
        probed=True,
    ),
    "M21 mm as m, five poses": read(
        some(
            without("x_mm", "y_mm", "z_mm", **{f"{a}_m": table()[f"{a}_mm"] for a in "xyz"}),
            slice(0, 5),
        ),
        probed=True,
    ),
    "M22 quaternion of wrong length": read(QUATERNION | {"qw": QUATERNION["qw"] * 1.1}),
    "M22 quaternion in another order": read(
        QUATERNION | dict(zip(("qw", "qx", "qy", "qz"),
                              [QUATERNION[f"q{a}"] for a in "xyzw"], strict=True)),
        probed=True,
    ),
    "M23 matrix mirrors": read(MATRIX | {f"r{k}1": -R[f"r{k}1"] for k in "123"}),
    "M23 matrix is no rotation": read(MATRIX | {"r11": R["r11"] + 0.01}),
    "M23 matrix by columns": read(
        MATRIX | {f"r{i}{j}": R[f"r{j}{i}"] for i in "123" for j in "123"}, probed=True
    ),
    "M24 order of the angles not stated": read(without("euler")),
    "M24 order of the angles means nothing": read(without("euler"), '[frames]\neuler = "xYZ"\n'),
    "M24 an axis twice": read(without("euler"), '[frames]\neuler = "ZYZ"\n'),
    "M24 another order of the angles": read(
        with_spread(columns(made(), euler="ZYX")) | {"euler": ["XYZ"] * 29}, probed=True
    ),
    "M25 a gap": read(wrong("x_mm", 15, "")),
    "M25 several": read(
        table(x_mm=["nan", "inf", "1e999", "1_0", "-", *table()["x_mm"][5:]])
    ),
    "M25 a pose without a name": read(table(pose_id=[*map(str, range(28)), ""])),
    "M25 poses without names": read(table(pose_id=[""] * 29)),
    "M25 read-back joints of a pose without a name": read(
        table() | READ | {"pose_id": [*map(str, range(28)), ""]},
        '[joints]\nsource = "read-back"\n[frames]\n',
    ),
    "M25 joints without a name": apart(JOINTS | {"pose_id": [*map(str, range(28)), ""]}, SEEN),
    "M25 readings without a name": apart(JOINTS, SEEN | {"pose_id": ["", *map(str, range(2, 30))]}),
    "M25 order with a name that is missing": apart(
        JOINTS | {"pose_id": [*map(str, range(28)), ""]}, SEEN, 'match = "order"'
    ),
    "M25 a target without a name": read(
        without("rx_deg", "ry_deg", "rz_deg", "euler") | {"target": ["R"] * 20 + [""] * 9},
        "[points]\n",
    ),
    "M27 three poses": identified(made(m=3)),
    "M27 two poses": identified(made(m=2)),
    "V6 an empty temperature": read(table(temperature_degC=["20.1"] * 28 + [""])),
    "V9 a coordinate of 1e300": read(wrong("x_mm", 15, "1e300")),
    "V9 a joint of 1e308": read(wrong("q2_deg", 15, "-1e308")),
    "V9 an uncertainty of 1e-300": read(wrong("uy_mm", 4, "1e-300")),
    "V9 covariances of 1e308": read(
        without(*SIGMA_COLUMNS) | dict.fromkeys(covariance_names(), ["1e308"] * 29)
    ),
    "V9 a reflector at 1e300": read(
        table(), "[points]\nreflectors_mm = { A = [0, 0, 1e300] }\n"
    ),
    "V10 an uncertainty of 1e-12": read(
        table(), "[frames]\n[uncertainty]\nposition_um = 1e-12\n"
    ),
    "V10 an uncertainty of 1e9": read(
        table(), "[frames]\n[uncertainty]\nposition_um = 1e9\nrotation_mdeg = 1e9\n"
    ),
    "V10 an MPE of nothing": read(table(), "[frames]\n[uncertainty]\nmpe_um = [0, 1e-300]\n"),
    "V31 no names": read("\n".join(csv(table()).split("\n")[1:])),
    "M27 nothing left": read(some(table(x_mm=[0] * 29, y_mm=[0] * 29, z_mm=[0] * 29), slice(0, 5))),
    "M31 readings without joints": apart(some(JOINTS, slice(0, 25)), SEEN),
    "M31 joints without readings": apart(JOINTS, some(SEEN, slice(0, 27))),
    "M31 joints twice": apart(
        JOINTS | {"pose_id": [1, 1, *range(3, 30)]}, some(SEEN, slice(2, 29))
    ),
    "M31 a visit twice": read(
        some(table(), [0, *range(29)])
        | {"pose_id": [1, *range(1, 30)], "repeat": [0] * 30, "x_mm": np.arange(30.0)}
    ),
    "M31 a pose with two joint vectors": read(table(pose_id=[1, *range(1, 29)])),
    "M31 unequal counts by order": apart(
        {k: v for k, v in JOINTS.items() if k != "pose_id"},
        some(SEEN, slice(0, 27)),
        'match = "order"',
    ),
    "M31 shifted rows": read(
        table(**{k: np.roll(table()[k], 1) for k in
                 ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg")}),
        probed=True,
    ),
    "M32 inverse transforms": read(
        with_spread(columns(made(), gives="T_tool_tracker")) | {"euler": ["XYZ"] * 29},
        probed=True,
    ),
    "M32 a frame that mirrors": read(table(y_mm=-table()["y_mm"]), probed=True),
    "M32 targets that are one place": read(
        {k: np.repeat(v, 2) for k, v in with_spread(columns(made()), turn=False).items()
         if k[:2] not in ("rx", "ry", "rz")} | {"target": ["A", "B"] * 29},
        probed=True,
    ),
    "M32 another robot": read(
        table(q2_deg=np.degrees(made().q[:, 1]) * 0.9, q3_deg=np.degrees(made().q[:, 2]) * 0.8),
        probed=True,
    ),
    "M33 nothing stated": read(without("ux_mm", "uy_mm", "uz_mm")),
    "M33 rotation not stated": read(without("urx_deg", "ury_deg", "urz_deg")),
    "M33 below zero": read(wrong("uy_mm", 4, "-0.01")),
    "M33 all zero": read(table(uy_mm=["0"] * 29)),
    "session: a stated uncertainty of zero": read(
        table(), "[frames]\n[uncertainty]\nposition_um = 0\n"
    ),
    "M34 covariance is none": read(
        without("ux_mm", "uy_mm", "uz_mm", "urx_deg", "ury_deg", "urz_deg")
        | {f"cov_{a}_{b}_{u}": [1e-10 if a == b else 2e-10 * ((a, b) == ("x", "y"))] * 29
           for a, b, u in (name.split("_", 3)[1:] for name in
                           covariance_names())}
    ),
    "M35 covariance not whole": read(table(cov_x_x_m2=[1e-10] * 29)),
    "M35 does not exist": lambda folder: read_session(folder / "a.csv", ROBOT),
    "session: a folder without session.toml": lambda folder: read_session(folder, ROBOT),
    "M31 a missed shot": slipped(np.delete(np.arange(29), 10)),
    "M31 a shot taken twice": slipped(np.insert(np.arange(29), 10, 9)[:29]),
    "M35 no joint target": rapid("! CONST jointtarget p1 := [[1],[9E9]];", "jointtarget a := "),
    "M35 a target that is not declared": rapid("MoveAbsJ home, v100, fine, tool0;"),
    "M35 empty": read("\n\n"),
    "M35 no joints": read(NO_JOINTS),
    "M35 a joint is missing": read(without("q4_deg")),
    "M35 no readings": read({k: v for k, v in table().items() if k[0] in "pq"}),
    "M35 ranges without angles": read(
        without("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg", "euler")
        | {"range_mm": [1500.0] * 29},
        "[points]\n" + SIGMAS,
    ),
    "M25 a section that finds nothing": read(
        without("rx_deg", "ry_deg", "rz_deg", "euler", distance_mm=[""] * 29, anchor=["A"] * 29),
        '[points]\n[ranges]\nanchors_mm = { A = "free" }\n',
    ),
    "M35 misspelled": read({k.replace("x_mm", "x_mmm"): v for k, v in table().items()}),
    "M35 an axis is missing": read(without("z_mm")),
    "M35 rotations in two forms": read(table() | R),
    "M35 a unit twice": read(table(x_m=table()["x_mm"])),
    "M35 commanded and read-back": read(table() | READ),
    "M35 held out by a session of several files": held_out(
        '[frames]\nfiles = ["a.csv", "b.csv"]\n'),
    "M35 held out in a table without joints": held_out(
        '[joints]\nfile = "joints.csv"\n[frames]\nfile = "frames.csv"\n'),
    "M35 a name twice": read(TEXT.replace("y_mm", "x_mm", 1)),
    "M35 a column without a name": read(TEXT.replace("y_mm", "", 1)),
    "M35 most columns without names": read(",,,pose_id\n1,2,3,4\n"),
    "M35 comments alone": read("# pose_id,q1_deg\n"),
    "M35 records in records": records([inside(12)]),
    "M36 records of too many columns": records([{f"c{k}": 1 for k in range(1001)}]),
    "M35 a short line": read(TEXT.replace(",0.0175", "", 1)),
    "M35 comma for both": read(csv(table(), decimal=",")),
    "M35 another mark than stated": read(
        table(), 'format = 1\nname = "s"\n[dialect]\ndecimal = ","\n'),
    "M35 comma and point": read(csv(table(), separator=";").replace(".", ",", 3)),
    "M35 thousands marks": read(wrong("x_mm", 3, "1.234.567")),
    "M35 thousands marks by spaces": read(wrong("x_mm", 3, "1 234.5")),
    "M35 comma of doubt": read(
        csv({k: ["1,234" if "mm" in k else "7"] * 29 for k in table()} | {"euler": ["XYZ"] * 29},
            separator=";")
    ),
    "M35 an open quote": read(TEXT.replace("XYZ", '"XYZ', 1)),
    "M35 UTF-16 that breaks off": read(TEXT.encode("utf-16")[:-1]),
    "S39 UTF-16 without a mark": read(TEXT.encode("utf-16-le")),
    "M35 split misspelled": read(table(split=["identfy"] * 29)),
    "M35 a pose in both parts": read(
        table(pose_id=[1, 1, *range(2, 29)],
              **{f"q{j + 1}_deg": np.degrees(made().q[[0, 0, *range(2, 29)], j])
                 for j in range(N)},
              split=["test", *["identify"] * 28])
    ),
    "M35 a repeat that is none": read(wrong("pose_id", 0, "1") | {"repeat": ["0.5"] * 29}),
    "M35 a mapped column is missing": read(table(), '[frames]\n[frames.columns]\nx_mm = "X"\n'),
    "M36 too large": read(table(), max_mb=0.001),
    "M36 too many rows": read("a\n" * 1_000_001),
    "M36 an endless line": read("a" * 70_000),
    "M36 gzip": packed,
    "M36 npz": archive(b"\x93NUMPY"),
    "S39 pickle": read(b"\x80\x04\x95\x00"),
    "S39 array of objects": read(b"\x93NUMPY\x01\x00v\x00{'descr': '|O'}"),
    "S39 MATLAB": read(b"MATLAB 5.0 MAT-file"),
    "S39 old workbook": read(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"),
    "S39 bytes": read(b"a,b\n\x00\x01"),
    "SA unit not stated": sa("A, B, 1, 1.5, 2.5, 3.5\nA, B, 2, 2.5, 3.5, 4.5\n"),
    "SA names in doubt": sa("1, 2, 3, 4\n2, 3, 4, 5\n", 'length = "mm"'),
    "SA no coordinates": sa("A, B, C\n", 'length = "mm"'),
    "SA unknown system": sa("// AXES = OBLIQUE: a, b, c (mm)\n1.0, 2.0, 3.0\n"),
    "SA cycles of unequal length": sa(
        "".join(f"A, S, {k % 3}, {k}.5, 2.5, 3.5\n" for k in range(8)), 'length = "mm"'
    ),
    "SA comments alone": sa("// X, Y, Z (mm)\n"),
    "SA a field behind the coordinates of no kind": sa(
        "// mm\nA, S, 1, 2.5, 3.5, 4.5, 0.1\n", 'length = "mm"\nafter = ["rms_mm"]'
    ),
    "SA more fields than there are": sa(
        "A, S, 1, 2.5, 3.5, 4.5, 0.1\n", 'length = "mm"\nafter = ["ux_mm", "uy_mm"]'
    ),
    "SA frames of six numbers as quaternions": sa_frames(
        "A, 1.5, 2.5, 3.5, 10, 20, 30\n", 'rotation = "quaternion_scalar_first"'
    ),
    "drift by two nests": points(
        {"target": ["B1", "B2", "SMR", "SMR"], "x_mm": [1, 2, 3, 4], "y_mm": [0, 1, 2, 4],
         "z_mm": [5, 6, 7, 7]}, '["B1", "B2"]'
    ),
    "drift by a nest nobody shot": points(
        {"target": ["B1", "B2", "SMR", "SMR"], "x_mm": [1, 2, 3, 4], "y_mm": [0, 1, 2, 4],
         "z_mm": [5, 6, 7, 7]}
    ),
    "session: unknown key": read(table(), '[frames]\neulr = "XYZ"\n'),
    "session: unknown table": read(table(), "[framse]\n"),
    "session: wrong value": read(table(), '[frames]\ngives = "T_tool"\n'),
    "session: an own name nobody knows": read(
        table(), '[frames.columns]\nx_millimeter = "x_mm"\n'
    ),
    "M36 an endless name": read(ranged(anchor=["A"] * 20 + ["9" * 5000] * 9)),
    "session: two sources": read(
        table(), "[frames]\n[uncertainty]\nposition_um = 2\nmpe_um = [15, 6]\n"
    ),
    "systematic parts without a size": read(table(), "[frames]\n[uncertainty.systematic]\n"),
    "systematic parts of which all are zero": read(
        table(), systematic("range_offset_um = 0", "encoder_amplitude_um = [0, 0.0]")
    ),
    "systematic parts beyond any instrument": read(
        table(), systematic("range_offset_um = 1e7", "scale_um_per_m = 1e5", "level_mdeg = -1")
    ),
    "systematic parts of a beam from nowhere": read(
        table(), systematic("range_offset_um = 2", "target_offset_um = 2", "level_mdeg = 0.5")
    ),
    "systematic angles of points": read(
        without("rx_deg", "ry_deg", "rz_deg", "euler") | {"target": ["R1"] * 29},
        systematic("target_turn_mdeg = 2", kind="points"),
    ),
    "systematic angles of distances": read(
        ranged(),
        systematic(
            "encoder_amplitude_um = [7, 3]", kind='ranges]\nanchors_mm = { A = "free" }\n[start'
        ),
    ),
    "systematic parts of a station that stands nowhere": read(
        table(), systematic("level_mdeg = 1", "station_up = [0, 0, 0]")
    ),
    "a systematic part misspelled": read(table(), systematic("range_ofset_um = 2")),
    "session: an anchor without a place": read(ranged()),
    "M25 a distance from no anchor": read(ranged(anchor=["A"] * 3 + [""] + ["A"] * 25)),
    "session: distances from no anchor": read(ranged(anchor=[""] * 29)),
    "session: a distance below zero": read(ranged(distance_mm=[1.0] * 28 + [-1.0])),
    "M25 a reading from no station": read(
        table(station=["1"] * 28 + [""]), "[frames]\n" + SIGMAS
    ),
    "M25 a payload below zero": read(table(payload_kg=[1.0] * 28 + [-1.0])),
    "M25 a row without a payload": read(table(payload_kg=["1.0"] * 28 + [""])),
    "V9 a payload beyond sense": read(table(payload_kg=[1.0] * 28 + [1e4])),
    "M25 a row without a tool": read(table(tool=["probe"] * 3 + [""] + ["probe"] * 25)),
    "M35 a payload in two places": read(
        table(payload_kg=[0.0] * 29), "[frames]\n[conditions]\npayload_kg = 2.0\n"
    ),
    "M35 a tool in one of two files": stations(SEEN | {"tool": ["probe"] * 29}, SEEN),
    "M25 a payload heavier than the arm": read(table(payload_kg=[80.0] * 29)),
    "session: a payload heavier than the arm": read(
        table(), "[frames]\n[conditions]\npayload_kg = 80.0\n"
    ),
    "M35 a center without a payload": read(table(**{f"payload_{a}_mm": [0.0] * 29 for a in "xyz"})),
    "V9 temperatures in kelvin": read(table(temperature_degC=[293.15] * 29)),
    "M35 half a center": read(table(payload_kg=[1.0] * 29, payload_z_mm=[0.0] * 29)),
    "M35 torques of one joint": read(table(torque1_Nm=[0.0] * 29)),
    "M35 torques without the first": read(table(torque2_Nm=[0.0] * 29)),
    "M35 torques in two units": read(table(torque1_Nm=[0.0] * 29, torque1_Nmm=[0.0] * 29)),
    "M35 torques and currents": read(table(torque1_Nm=[0.0] * 29, current1_A=[0.0] * 29)),
    "V9 a torque beyond sense": read(
        table(**{f"torque{j}_Nm": [0.0] * 28 + [1e9] for j in range(1, 7)})
    ),
    "session: a gear ratio of zero": read(table(), "[gear]\nratio = { joint1 = 0 }\n"),
    "session: a gear of no joint": read(table(), "[frames]\n[gear]\nratio = { joint7 = 100 }\n"),
    "session: a gear of no name": read(table(), "[gear]\nratio = { elbow = 100 }\n"),
    "session: a center without a payload": read(
        table(), "[conditions]\npayload_center_mm = [0, 0, 50]\n"
    ),
    "session: a material": read(table(), '[identification]\nmaterial = "wood"\n'),
    "session: a payload below zero": read(table(), "[conditions]\npayload_kg = -1\n"),
    "session: no day": read(table(), '[conditions]\ndate = "22.11.2026"\n'),
    "session: conditions misspelled": read(table(), "[conditions]\ntemperature_c = 20\n"),
    "session: a tool without a name": read(table(), '[use]\ntool = ""\n'),
    "session: a tolerance of use": read(table(), "[use]\npayload_tolerance_kg = 1\n"),
    "program: a row without a payload": program(payload_kg=["0", ""]),
    "program: a payload below zero": program(payload_kg=["0", "-2"]),
    "program: a temperature beyond sense": program(temperature_degC=["20", "1e5"]),
    "program: a joint in two units": program(q1_rad=[0.1, 0.2]),
    "program: angles in no order": cartesian(),
    "program: angles in an order that means nothing": cartesian(euler=["abc", "abc"]),
    "program: a target without a tool": program(tool=["probe", ""]),
    "session: a target without a place": read(
        without("rx_deg", "ry_deg", "rz_deg", "euler") | {"target": ["R2"] * 29},
        "[points]\nreflectors_mm = { R1 = [1.0, 2.0, 3.0] }\n",
    ),
    "session: a start of what is known": read(
        without("rx_deg", "ry_deg", "rz_deg", "euler") | {"target": ["R1"] * 29},
        "[points]\nreflectors_mm = { R1 = [1.0, 2.0, 3.0] }\n"
        "[start]\nreflectors_mm = { R1 = [1.0, 2.0, 3.0] }\n",
    ),
    "session: a start of an unknown anchor": read(
        ranged(),
        '[ranges]\nanchors_mm = { A = "free" }\n[start]\nanchors_mm = { a = [1.0, 2.0, 3.0] }\n',
    ),
    "session: an endless number": read(table(), "format = " + "1" * 5000),
    "session: a tolerance without a rule": read(table(), "[tolerance]\nposition_um = 50\n"),
    "session: a tolerance of nothing": read(
        table(), '[tolerance]\nposition_um = 0\nrule = "guarded"\n'
    ),
    "session: a rule nobody knows": read(
        table(), '[tolerance]\nposition_um = 50\nrule = "guard"\n'
    ),
    "session: a rule without a tolerance": read(table(), '[tolerance]\nrule = "simple"\n'),
    "session: a prior of no width": read(table(), "[prior]\nlength_mm = 0.0\n"),
    "session: a prior of a negative width": read(table(), "[prior]\nangle_deg = -0.1\n"),
    "session: a prior of a joint that is not there": read(
        table(), "[prior]\njoints = [{ joint = 7, length_mm = 0.2 }]\n"
    ),
    "session: a prior of one joint twice": read(
        table(), "[prior]\njoints = [{ joint = 2, length_mm = 1 }, { joint = 2, angle_deg = 1 }]\n"
    ),
    "session: a tool in use nowhere": read(table(), '[tool_in_use]\nname = "gripper"\n'),
    "session: a tool in use that is not finite": read(
        table(), "[tool_in_use]\npoint_mm = [0.0, nan, 150.0]\n"
    ),
    "session: a tool in use meters away": read(
        table(), "[tool_in_use]\npoint_mm = [0.0, 0.0, 15000.0]\n"
    ),
    "session: a tool in use in a box of negative size": read(
        table(), "[tool_in_use]\npoint_mm = [0.0, 0.0, 150.0]\nbox_mm = [0.0, -1.0, 0.0]\n"
    ),
    "session: poses of no kind": read(table(), '[identification]\nheld_out = "random"\n'),
    "session: not TOML": read(table(), "joints\n"),
    "session: a file elsewhere": read(table(), '[joints]\nfile = "../../etc/passwd"\n[frames]\n'),
    "sessions: one without poses": visits(A + '[[session]]\nname = "b"\n'),
    "sessions: two of one name": visits(A + A),
    "sessions: same as nobody": visits(A + B + 'base = "same as A"\n'),
    "sessions: neither free nor the same": visits(A + B + 'tool = "fixed"\n'),
    "sessions: a tool in a circle": visits(
        A + 'tool = "same as b"\n' + B + 'tool = "same as a"\n'
    ),
    "sessions: a payload in a circle": visits(A + 'payload = "same as a"\n'),
    "sessions: a payload that nobody states": visits(A + B + 'payload = "same as a"\n'),
    "sessions: a payload in one of two": visits(
        A + "conditions = { payload_kg = 2 }\n" + B + "[conditions]\n",
        b=table(x_mm=table()["x_mm"] + 1.0),
    ),
    "sessions: too few poses for frames": visits(A + B + "held_out = true\nframe_poses = 5\n"),
    "sessions: frames fitted to nothing": visits(A + B + "held_out = true\n"),
    "sessions: poses for no frames": visits(A + B + "frame_poses = 10\n"),
    "sessions: all held out": visits(A + "held_out = true\nframe_poses = 10\n"),
    "sessions: a start": visits(A + B + "[start]\n"),
    "sessions: a key misspelled": visits(A + 'bas = "free"\n'),
    "sessions: a name of two parts": visits(A + '[[session]]\nname = "a/b"\nfile = "b.csv"\n'),
    "sessions: one file twice": visits(A + B),
    "sessions: too many": visits(A * 101),
    "sessions: a file elsewhere": visits(
        A + '[[session]]\nname = "b"\nfile = "../../etc/passwd"\n'
    ),
    "sessions: --test beside them": lambda folder: (
        (folder / "session.toml").write_text(A), (folder / "t.csv").write_text(csv(table())),
        read_held_out(folder / "t.csv", ROBOT, folder),
    ),
    "sessions: distances": visits(A + B, b=ranged()),
    "sessions: joints of another kind": visits(
        A + B + '[session.joints]\nsource = "read-back"\n',
        b=table(x_mm=table()["x_mm"] + 1.0)
        | {f"q{k + 1}_read_deg": np.degrees(made().q[:, k]) for k in range(N)},
    ),
    "session: no file": lambda folder: (
        (folder / "session.toml").write_text("[frames]\n"), read_session(folder, ROBOT)
    ),
}  # fmt: skip


def told(session):
    return [*session.masked, *session.warnings]


def silent(ladder, config=None, torque=None, **changes):
    """Why a ladder offers nothing of rows that say something: no reason ends a calibration."""

    def sentences(folder):
        tau = weight_of(ROBOT.model.chain, moments=ROBOT.moments).torques(made().q)[:, :, 2]
        load = {} if torque is None else {
            f"torque{k + 1}_Nm": column for k, column in enumerate(torque(tau).T)
        }  # fmt: skip
        session = read(table(**changes, **load), config)(folder)
        found = row_ladders(ROBOT.model, session.measurements, row_terms(session, ROBOT))
        return [why for one in found if one.name == ladder for why in one.why_not]

    return sentences


def reduced(case):
    """What an identification cannot tell, in words."""

    def sentences(folder):
        found = case(folder).reduction
        return [f"rank {found.rank}", *found.unobservable, *found.sentences[:6]]

    return sentences


SAID = {
    "M22 rounded quaternions": lambda f: told(
        read(QUATERNION | {"qw": QUATERNION["qw"] * (1 + 2e-4)})(f)
    ),
    "M23 rounded matrices": lambda f: told(read(MATRIX | {"r11": R["r11"] + 1e-5})(f)),
    "M25 left out": lambda f: told(read(wrong("x_mm", 15, ""), drop_invalid=True)(f)),
    "V6 a temperature left out": lambda f: told(
        read(table(temperature_degC=["20.1"] * 28 + ["warm"]), drop_invalid=True)(f)
    ),
    "V9 left out": lambda f: told(read(wrong("x_mm", 15, "1e300"), drop_invalid=True)(f)),
    "V10 odd uncertainties": lambda f: told(read(
        table(), "[frames]\n[uncertainty]\nposition_um = 1e-3\nrotation_mdeg = 2e4\n")(f)),
    "odd systematic parts": lambda f: told(read(table(), systematic(
        "target_offset_um = 2e4", "target_turn_mdeg = 1e-3"))(f)),
    "V10 odd uncertainties in the table": lambda f: told(read(wrong("uy_mm", 4, "1e-9"))(f)),
    "M26 copied rows": lambda f: told(read(some(table(), [*range(29), 3, 4]) | {
        "pose_id": [*range(31)]})(f)),
    "M28 a joint that never moves": reduced(identified(frozen_joint(made(), 2))),
    "M30 structural redundancies": reduced(identified(made())),
    "M31 swapped rows": lambda f: told(read(table(**{
        k: np.asarray(table()[k])[[0, 2, 1, *range(3, 29)]]
        for k in ("x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg")}))(f)),
    "M31 a wrong lock": lambda f: told(read(wrong("x_mm", 8, "404.0"))(f)),
    "M33 rounded to zero": lambda f: told(
        read(table(uy_mm=["0.000"] * 20 + ["0.003"] * 9))(f)
    ),
    "M33 not known in some rows": lambda f: told(
        read(table(uy_mm=["0"] * 9 + ["0.0031"] * 10 + ["0.01"] * 10))(f)
    ),
    "missed shots": lambda f: told(read(table(**{
        f"{a}_mm": np.where(np.arange(29) % 9 == 4, 0, table()[f"{a}_mm"]) for a in "xyz"}))(f)),
    "a column misspelled": lambda f: told(read(table(repaet=[0] * 29))(f)),
    "a payload without a center": lambda f: [
        one for one in read(table(payload_kg=[1.0] * 29))(f).notes if "center" in one
    ],
    "an order that is none": lambda f: [
        one for one in read(table(order=[*range(20), *range(9)]))(f).notes if "order" in one
    ],
    "torques in another unit": silent("torque", torque=lambda tau: 1e3 * tau),
    "torques that never change": silent("torque", torque=lambda tau: 0 * tau + 3.0),
    "a temperature that never changes": silent("lengths", temperature_degC=[20.0] * 29),
    "a temperature that hardly changes": silent(
        "lengths", temperature_degC=20 + 0.01 * np.arange(29)
    ),
    "a gear whose wave is on a grid": silent(
        "gear", "[frames]\n[gear]\nratio = { joint1 = 72 }\n",
        q1_deg=5.0 * np.round(table()["q1_deg"] / 5),
    ),
    "times that are none": lambda f: told(
        read(table(time=[f"shot {k}" for k in range(29)]))(f)
    ),
    "torques at one station and currents at the other": lambda f: [
        why for what, why in stations(
            SEEN | {f"torque{j}_Nm": np.arange(29.0) for j in range(1, 7)},
            SEEN | {f"current{j}_A": np.arange(29.0) for j in range(1, 7)}
            | {"x_mm": SEEN["x_mm"] + 1.0},
        )(f).rows_say.unsaid if what == "torque"
    ],
    "another robot's name": lambda f: told(read(table(), 'robot = "kuka"\n[frames]\n')(f)),
    "a rounded clock": lambda f: told(read(table(time=["2.02011E+13"] * 29))(f)),
    "joints without readings": lambda f: told(
        read_session(_apart(f), ROBOT, options=ReadOptions(drop_invalid=True))
    ),
}  # fmt: skip


def _apart(folder):
    with pytest.raises(CalibError):
        apart(JOINTS, some(SEEN, slice(0, 27)))(folder)
    return folder


@cache
def result(name):
    """Message of a case, or what is said of one that is read."""
    with TemporaryDirectory() as made_here, no_hang():
        folder = Path(made_here)
        if name in CASES:
            with pytest.raises(CalibError) as caught:
                CASES[name](folder)
            lines = [str(caught.value)]
        else:
            lines = [str(line) for line in SAID[name](folder)]
        return "\n".join(lines).replace(made_here, "DIR")


def test_messages_are_word_for_word_as_written_down():
    blocks = [f"{name}\n{result(name)}\n" for name in (*CASES, *SAID)]
    assert_as_written("\n".join(blocks), "file_messages.txt")


@pytest.mark.parametrize("name", CASES)
def test_each_message_is_short_and_knows_no_insides(name):
    shown = result(name)
    assert shown.endswith("]")
    code = shown[shown.rindex("[") + 1 : -1]
    assert code.isalnum()
    if name[0] in "MS" and name[1:3].isdigit():
        assert name.startswith(code)
    assert len(shown) < 520
    for word in ("pydantic", "Traceback", "NoneType", "dtype", "object at 0x", "<class", "float64"):
        assert word not in shown


def test_every_row_of_bad_input_has_its_case():
    known = {name.split()[0] for name in (*CASES, *SAID)}
    # M29, poses too much alike, is told by the calibration: no file is wrong then
    assert {f"M{row}" for row in range(20, 37) if row != 29} | {"S39"} <= known
