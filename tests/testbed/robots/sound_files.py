"""Small sound robots in every format."""

import re

import trimesh

from tests.testbed.robots.described_cases import CORNERS, MJCF, SIDES, TURN, block, urdf
from tests.testbed.robots.robot_cases import TX60

MESH = '<geometry><mesh filename="{}" scale="1 1 1"/></geometry>'
PART = f'<visual><origin xyz="0.1 0 0"/>{MESH}</visual><collision>{MESH}</collision>'
ARM = urdf(
    "arm",
    [
        ("pan", "revolute", "0 0 0.1", "0 0 0", "0 0 1", TURN),
        ("lift", "prismatic", "0 0.2 0", "0 1.57 0", "0 1 0", (0, 0.3)),
        ("roll", "continuous", "0 0.2 0", "0 1.57 0", "0 1 0", None),
        ("flange", "fixed", "0 0 0.1", "0 0 0", "1 0 0", None),
    ],
    parts={
        "pan": PART.format("part.stl", "part.stl"),
        "lift": PART.format("part.obj", "part.obj"),
        "roll": PART.format("part.dae", "part.ply"),
    },
)
OBJ = "".join(
    ["o a\nvn 0 0 1\n", *("v {} {} {}\n".format(*corner) for corner in CORNERS)]
    + [f"f {a + 1}//1 {b + 1}//1 {c + 1}//1\n" for a, b, c in SIDES]
)
BOX = trimesh.creation.box((1, 1, 1))
ROBOT = re.sub(r'file = "[^"]*"', 'file = "part.obj"', (TX60.folder / "robot.toml").read_text())
ROBOT = "[[parts]]".join(ROBOT.split("[[parts]]")[:3])
SOUND = {
    "arm.urdf": ARM.encode(),
    "arm.xml": MJCF.encode(),
    "meshes.xml": MJCF.replace('meshdir="assets"', "").replace("block.stl", "part.obj").encode(),
    "robot.toml": ROBOT.encode(),
    "part.stl": block(),
    "assets/block.stl": block((80.0, 60.0, 100.0), (-40.0, -30.0, 0.0)),
    "part.obj": OBJ.encode(),
    "part.dae": trimesh.exchange.dae.export_collada(BOX),
    "part.ply": BOX.export(file_type="ply"),
}
"""Files that make four robots."""
