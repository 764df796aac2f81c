"""Small whole files of every kind, to be damaged."""

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from testbed.assets import scenes
from testbed.identify.records import HeldOutSplit, Origin
from testbed.laboratory.truth.setting import Setting
from testbed.run.play import play_run
from testbed.scenario.read import dump_scenario
from testbed.store import layout, npz
from testbed.studies import load_scenario
from testbed.studies.trial.set_records import PoseCountStudy, RandomSets, RandomSetsStudy
from tests.testbed.files.made import ROBOT, made
from tests.testbed.files.test_whole_files import FILES
from tests.testbed.iso9283.made import SESSION, path_rows, pose_rows, text_of
from tests.testbed.robots.described_cases import MJCF, block, urdf
from tests.testbed.robots.sound_files import SOUND
from tests.testbed.studies.trial.fake_campaign import Fake, scenario

Files = Mapping[str, bytes]
"""Content of the files of a folder, by name."""


def encoded(files: Mapping[str, str]) -> Files:
    """Texts as bytes."""
    return {name: text.encode() for name, text in files.items()}


CELL = """format = 1
name = "cell"
robot = "staubli_tx60"
[[cell.obstacle]]
kind = "box"
size_mm = [600.0, 600.0, 50.0]
position_mm = [900.0, 0.0, -300.0]
[[cell.obstacle]]
kind = "mesh"
file = "fixture.stl"
position_mm = [-900.0, 0.0, 0.0]
[plan]
poses = 20
measured = "measured.csv"
[plan.goal]
kind = "list"
joints_deg = [[0.0, 10.0, 80.0, 0.0, 40.0, 0.0], [10.0, -20.0, 90.0, 5.0, 30.0, -60.0]]
[plan.use]
payload_kg = 2.5
tool = "gripper"
[plan.stations]
list_mm = [[2500.0, 0.0, 500.0], [0.0, 2500.0, 500.0]]
[[trial]]
name = "random-20"
poses = 20
method = "random"
"""
OBJ = """v 0 0 0
v 10 0 0
v 0 10 0
v 0 0 10
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
"""
MESH = """
    <visual>
      <origin xyz="0 0 0.05" rpy="0 0 0"/>
      <geometry><mesh filename="part.{}" scale="0.01 0.01 0.01"/></geometry>
      <material name="gray"><color rgba="0.5 0.5 0.5 1"/></material>
    </visual>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
    <collision><geometry><capsule radius="0.05" length="0.1"/></geometry></collision>"""
LINKS = [
    ("pan", "revolute", "0 0 0.3", "0 0 0", "0 0 1", (-3.0, 3.0)),
    ("slide", "prismatic", "0.1 0 0.1", "0 1.5 0", "0 0 1", (0, 0.5)),
    ("spin", "continuous", "0 0 0.2", "0 0 0.1", "0 1 0", None),
]
ROBOT_TOML = """format = 1
name = "short"
title = "A short arm"
floor_mm = 100.0

[colors]
gray = [0.5, 0.5, 0.5]

[[parts]]
name = "block"
link = 1
file = "part.stl"
color = "gray"
collides = true

[base]
position_mm = [0.0, 0.0, 300.0]
rotation_vector_deg = [0.0, 0.0, 90.0]

[tool]
position_mm = [0.0, 0.0, 100.0]

[workspace]
box_center_mm = [300.0, 0.0, 300.0]
box_size_mm = [400.0, 400.0, 400.0]
station_mm = [2500.0, 0.0, 500.0]
joint_ranges_deg = [[-90.0, 90.0], [0.0, 400.0]]

[controller]
joints = ["q2 = J2 - 1/20 mm/deg J1"]
limits_mm = { J2 = [-500.0, 500.0] }

[[joints]]
kind = "revolute"
theta_deg = 0.0
d_mm = 200.0
a_mm = 50.0
alpha_deg = -90.0
lower_deg = -170.0
upper_deg = 170.0
max_speed_deg_s = 200.0
repeatability_urad = 30.0
mass_kg = 8.0
center_mm = [0.0, 0.0, -50.0]
inertia_kg_m2 = [0.05, 0.05, 0.03]

[[joints]]
kind = "prismatic"
theta_deg = 90.0
d_mm = 100.0
a_mm = 0.0
alpha_deg = 0.0
beta_deg = 0.1
lower_mm = 0.0
upper_mm = 500.0
max_speed_mm_s = 800.0
repeatability_um = 10.0
mass_kg = 4.0
center_mm = [0.0, 20.0, 0.0]
inertia_kg_m2 = [0.02, 0.02, 0.01]

[[joint_terms]]
name = "sag1"
joint = 1
wave = "sin"
weights = [1, 0]
coefficient_deg = 0.01

[[reflectors]]
name = "R1"
position_mm = [10.0, 0.0, 20.0]

[free_sets]
few = ["theta1", "a1"]

[sources]
geometry = "made up"
"""
PROGRAM_OF_JOINTS = """# two targets
name,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,payload_kg,tool,temperature_degC
A,0,10,80,0,40,0,0,probe,20
B,10,-20,90,5,30,-60,2.5,gripper,21.5
"""
PROGRAM_OF_POSES = """\
q1_deg;q2_deg;q3_deg;q4_deg;q5_deg;q6_deg;euler;x_mm;y_mm;z_mm;rx_deg;ry_deg;rz_deg
0;10;80;0;40;0;XYZ;{}
10;-20;90;5;30;-60;XYZ;{}
"""
PLAN = """\
pose_id,role,order,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,move,approach_s,payload_kg,tool
start,start,,0,0,0,0,0,0,,,2,probe
P1,identify,1,0,10,80,0,40,0,straight,1.5,2,probe
P2,identify,2,10,-20,90,5,30,-60,straight,2.5,2,probe
T1,test,3,1,2,90,4,30,6,straight,1,2,probe
"""
DATA = made(11, 12)
REAL = ROBOT.model.moved(np.full(ROBOT.model.n_numbers, 1e-5))
"""A robot a little off its nominal model."""
SPEC = "0" * 64
ONES = np.ones((2, 2))
RECORDED = (
    Setting(
        nominal=ROBOT.model,
        true=REAL,
        joint_repeatability=np.full(6, 1e-5),
        pool_q=DATA.q,
        pool_nominal=DATA.T,
        rejected_q=DATA.q[:2],
        rejected_reason=("floor", "floor"),
        rejection_names=("floor", "itself"),
        rejection_counts=np.array([2, 0]),
        n_drawn=14,
        test_q=DATA.q[:3],
        test_true=DATA.T[:3],
        T_world_tracker=np.eye(4),
        target=np.zeros(3),
    ),
    PoseCountStudy(np.array([10, 20]), ("O1", "O2"), ONES, ONES, ONES, (20, None)),
    RandomSetsStudy((RandomSets("a", "O1", "1", True, 20, 0.5, np.array([0.1, 0.2])),)),
    HeldOutSplit(np.array([True, False]), np.array([False, True]), False, 1, "one of two"),
    Origin("a", (("a.csv", SPEC),), "b", "B", SPEC, (), True, "commanded", "", (), (), (), ()),
    npz.Failure("it did not converge"),
)
KINDS = {type(one).__name__: type(one) for one in RECORDED}
ESTIMATE = {
    "believable": True,
    "contradicted": False,
    "chi_square_per_dof": None,
    "held_out_before": {"mean_mm": 0.5},
    "held_out_after": {"mean_mm": 0.01, "p95_mm": 0.02, "max_mm": 0.03},
    "stated_u_3d_rms_mm": 0.02,
    "held_out_inside_95": 0.9,
}
RESULT = {
    "format": 1,
    "notice": "SIMULATED - not a calibration certificate",
    "scenario": "tiny",
    "seed": 1,
    "verdict": {"believable": True, "contradicted": False, "sentence": "fine", "reasons": []},
    "trials": {"a": {"poses": 20, "estimates": {"whitened": ESTIMATE}}},
    "failed": {"b": "it did not converge"},
}


def program_of_poses() -> str:
    """Targets as positions and angles, with the joints near which they are reached."""
    q = np.radians([[0, 10, 80, 0, 40, 0], [10, -20, 90, 5, 30, -60]])
    T = ROBOT.model.poses(q)
    angles = Rotation.from_matrix(T[:, :3, :3]).as_euler("XYZ", degrees=True)
    rows = np.hstack([1e3 * T[:, :3, 3], angles])
    return PROGRAM_OF_POSES.format(*(";".join(f"{one:.6f}" for one in row) for row in rows))


def run_folder() -> Files:
    """Files of a run of a study that takes no time."""
    fake = Fake(size=4)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "run"
        play_run(scenario(), folder, studies=[fake], derive=fake.derive)
        kept = [path for path in folder.rglob("*") if path.suffix in (".toml", ".json", ".npz")]
        return {str(path.relative_to(folder)): path.read_bytes() for path in kept}


def session(files: Mapping[str, str]) -> Files:
    """A table of measurements and a session.toml beside it."""
    texts = {name.replace("s.toml", "session.toml"): text for name, text in files.items()}
    return encoded({"session.toml": "[frames]\n", **files} if len(files) == 1 else texts)


SCENARIOS = (
    *({"scenario.toml": file.read_bytes()} for file in sorted(scenes().glob("*.toml"))),
    encoded({"scenario.toml": dump_scenario(load_scenario("quick"))}),
    encoded({"scenario.toml": CELL, "measured.csv": PLAN}) | {"fixture.stl": block()},
)
SESSIONS = tuple(session(files) for files, _, _ in FILES.values())
DOCUMENTS = (
    encoded({"m.json": json.dumps({"samples": [
        {"q": list(q), "tool": {"position": list(q[:3]), "time": 0.5 * k}, "name": f"P{k}"}
        for k, q in enumerate(((0.1, 0.2, 0.3, 0.4, 0.5, 0.6), (0.6, 0.5, 0.4, 0.3, 0.2, 0.1)))
    ]})}),
    encoded({"m.json": json.dumps({"q": [[0.1] * 6] * 3, "p": [[0.4, 0.1, 0.2]] * 3})}),
)  # fmt: skip
LOGS = tuple(encoded({"m.txt": text}) for text in (
    "".join(f"{{E6POS: A1 {k}.5, A2 -{k}, A3 3, X 0.{k}, Y 2, Z {k}e-1}}\n" for k in range(5)),
    '"A1\n[deg]","A2\n[deg]","A3\n[deg]",X,Y,"Z\n[mm]"\n' + "1,2,3,4,5,6\n" * 4,
))  # fmt: skip
ARMS = (
    encoded({"arm.urdf": urdf("arm", LINKS, parts={"pan": MESH.format("obj")}), "part.obj": OBJ}),
    encoded({"arm.urdf": urdf("arm", LINKS, parts={"pan": MESH.format("stl")})})
    | {"part.stl": block()},
    encoded({"arm.xml": MJCF}) | {"assets/block.stl": block()},
    SOUND,
)
ROBOTS = (encoded({"robot.toml": ROBOT_TOML}) | {"part.stl": block()}, SOUND)
PLANS = (encoded({"plan.csv": PLAN}),)
CYCLES = (
    encoded(
        {
            "session.toml": SESSION,
            "cycles.csv": text_of(pose_rows(n=20)[:100]),
            "path.csv": text_of(path_rows(n=4, m=6)),
        }
    ),
)
PROGRAMS = (
    encoded({"program.csv": PROGRAM_OF_JOINTS}),
    encoded({"program.csv": program_of_poses()}),
)
RUNS = (run_folder() | {layout.RESULT: npz.pretty_json(RESULT)},)
RECORDS = tuple(
    {f"{name}.npz": npz.record_bytes(name, one, SPEC)}
    for name, one in zip(KINDS, RECORDED, strict=True)
)
