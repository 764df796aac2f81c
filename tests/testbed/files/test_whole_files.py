"""Whole files of every dialect, which are read; `tests/fuzz` damages them."""

import numpy as np
import pytest

from calib.errors import CalibError
from testbed.files.probe import probe
from testbed.files.read import read_session
from tests.testbed.files.made import ROBOT, columns, csv, made, with_spread
from tests.testbed.files.test_session import ARMS, points_of

SIGMAS = "[uncertainty]\nposition_um = 20\nrotation_mdeg = 10\ndistance_um = 20\n"
SHARED = (
    "[uncertainty.systematic]\nrange_offset_um = 2\nencoder_amplitude_um = [7.5, 3.0]\n"
    "target_turn_mdeg = 3\nlevel_mdeg = 0.5\nstation_mm = [0, -2000.0, 300]\n"
)
STATED = (
    '[conditions]\npayload_kg = 1.5\ntool = "probe"\ntemperature_degC = 20.5\n'
    'date = "2026-11-22"\ntemperature_tolerance_k = 1.0\n[use]\npayload_kg = 1.0\n'
)
DATA = made(11, 12)
CONDITIONS = {"payload_kg": [0.5] * 12, "tool": ["probe"] * 12, "temperature_degC": [20.5] * 12}
POSES = csv(
    with_spread(columns(DATA))
    | {"euler": ["XYZ"] * 12, "split": ["test"] + ["identify"] * 11}
    | CONDITIONS
)
MATRIX = csv(columns(DATA, form="matrix"), separator=";", decimal=",")
POINTS = csv(points_of(DATA, ARMS, "ABC"), separator="\t")
RANGES = csv(
    {k: v for k, v in columns(DATA, form="none").items() if "_mm" not in k}
    | {"anchor": ["A"] * 12, "distance_mm": np.linalg.norm(DATA.T[:, :3, 3], axis=1) * 1e3}
)
JOINTS = csv({k: v for k, v in columns(DATA).items() if k[0] in "pq"})
SA = "// AXES = CARTESIAN: X, Y, Z (mm)\n" + "".join(
    f"Coll, Main, {k + 1}, {x:.6f}, {y:.6f}, {z:.6f}, 02/12/25 16:38:29\n"
    for k, (x, y, z) in enumerate(1e3 * DATA.T[:, :3, 3])
)
RAPID = "\n".join(
    f"CONST jointtarget p{k + 1} := [[{','.join(f'{v:.9f}' for v in np.degrees(row))}],[9E9,9E9]];"
    for k, row in enumerate(DATA.q)
)
DEG = np.degrees(DATA.q)
KRL = "DEF A()\n" + "\n".join(
    f"PTP {{{','.join(f'A{k + 1} {v:.9f}' for k, v in enumerate(row))}}} C_PTP" for row in DEG
)
TP = "/POS\n" + "\n".join(
    f"P[{j}]{{\nGP1:\n{', '.join(f'J{k + 1}= {v:.9f} deg' for k, v in enumerate(row))}\n}};"
    for j, row in enumerate(DEG, 1)
)
UR = "def a():\n" + "\n".join(f"movej([{','.join(map(str, row))}], a=1)" for row in DATA.q)
LISTS = [", ".join(f"{v:.9f}" for v in row) for row in DEG]
DRL = "\n".join(f"movej(posj({row}), v=30, a=30)" for row in LISTS)
AS = ".JOINTS\n" + "\n".join(f"#p{k} {row.replace(',', '')}" for k, row in enumerate(LISTS))
JBI = "/JOB\n//POS\n///POSTYPE ANGLE\n" + "\n".join(
    f"C{k:05d}={row.replace(' ', '')}" for k, row in enumerate(LISTS)
)
VAL3 = "begin\n" + "\n".join(f"movej({{{row}}}, tTool, mNom)" for row in LISTS)
PROGRAM = (
    'match = "order"\n[joints]\nfile = "cal.txt"\nformat = "rapid"\n'
    f'[points]\nfile = "smr.txt"\nformat = "sa"\n{SIGMAS}'
)
CONFIG = f'[joints]\nfile = "joints.csv"\n[points]\nfile = "smr.txt"\nformat = "sa"\n{SIGMAS}'
NESTS = f'[points]\n[drift]\nnests = ["A", "B", "C"]\n{SIGMAS}'
VISITS = (
    f'[frames]\neuler = "XYZ"\n{SIGMAS}'
    '[[session]]\nname = "b"\nfile = "b.csv"\npayload = "same as d"\n'
    '[[session]]\nname = "c"\nfile = "c.csv"\nbase = "same as b"\npayload = "same as d"\n'
    '[[session]]\nname = "d"\nfile = "d.csv"\nheld_out = true\nframe_poses = 6\n'
    'conditions = { payload_kg = 1, date = "2026-11-22" }\n'
)
PLACES = DATA.T[:, :3, 3]
FAR = np.linalg.norm(PLACES, axis=1)
CLOCK = {"time": [f"23:{50 + k // 6}:{k % 6}0" for k in range(len(DATA.q))]}
LOG = csv(CLOCK | {f"q{j + 1}_deg": column for j, column in enumerate(DEG.T)})
DIRECTIONS = csv(
    CLOCK
    | {"azimuth_gon": -200 / np.pi * np.arctan2(PLACES[:, 1], PLACES[:, 0])}
    | {"zenith_gon": 200 / np.pi * np.arccos(PLACES[:, 2] / FAR), "range_m": FAR}
) + "Total points: 12\n"  # fmt: skip
CLOCKS = (
    'match = "time"\nmatch_within_s = 2\n[joints]\nfile = "joints.csv"\n'
    f'[points]\nfile = "a.csv"\nazimuth = "clockwise"\n{SIGMAS}'
)
FILES = {
    "directions": (
        {"a.csv": DIRECTIONS, "joints.csv": LOG, "session.toml": CLOCKS}, "session.toml", None
    ),
    "poses": ({"a.csv": POSES}, "a.csv", None),
    "matrices": ({"a.csv": MATRIX, "s.toml": f"[frames]\n{SIGMAS}{SHARED}"}, "a.csv", "s.toml"),
    "points": ({"a.csv": POINTS, "s.toml": f"[points]\n{SIGMAS}{STATED}"}, "a.csv", "s.toml"),
    "nests": ({"a.csv": POINTS, "s.toml": NESTS}, "a.csv", "s.toml"),
    "ranges": (
        {"a.csv": RANGES, "s.toml": f'[ranges]\nanchors_mm = {{ A = "free" }}\n{SIGMAS}'},
        "a.csv",
        "s.toml",
    ),
    "spatial analyzer": (
        {"joints.csv": JOINTS, "smr.txt": SA, "session.toml": CONFIG}, "session.toml", None
    ),
    "visits": (
        {f"{name}.csv": csv(columns(made(k, 12))) for k, name in enumerate("bcd", 12)}
        | {"session.toml": VISITS},
        "session.toml", None,
    ),
    **{
        name: (
            {"cal.txt": text, "smr.txt": SA, "session.toml": PROGRAM.replace("rapid", name)},
            "session.toml", None,
        )
        for name, text in (
            ("rapid", RAPID), ("krl", KRL), ("fanuc", TP), ("urscript", UR), ("doosan", DRL),
            ("kawasaki", AS), ("inform", JBI), ("val3", VAL3),
        )
    },
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_every_whole_file_is_read(tmp_path, name):
    files, data, config = FILES[name]
    for file, text in files.items():
        (tmp_path / file).write_bytes(text.encode())
    toml = None if config is None else tmp_path / config
    if name == "nests":
        with pytest.raises(CalibError, match="holds shots at nests only"):
            read_session(tmp_path / data, ROBOT, config=toml)
    else:
        probe(ROBOT, read_session(tmp_path / data, ROBOT, config=toml)).raise_if_wrong()
