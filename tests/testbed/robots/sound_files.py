"""Small sound robots in every format, and one thing of them changed at random."""

import random
import re
from copy import deepcopy

import trimesh
from lxml import etree

from tests.testbed.robots.described_cases import CORNERS, MJCF, SIDES, TURN, block, urdf
from tests.testbed.robots.robot_cases import TX60

VALUES = (
    *("0", "nan", "inf", "1e300", "1e-300", "-1", "", "word", "0 0 0", "1 2", "1,5", "1e9"),
    *("true", "\u00e4", "1e5", "x" * 300, "../x"),
)
"""What a word becomes."""
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
READ_BY = {
    "part.stl": "arm.urdf", "part.dae": "arm.urdf", "part.ply": "arm.urdf",
    "assets/block.stl": "arm.xml",
}  # fmt: skip
"""Which robot has a mesh; those of OBJ are in three."""


def mutated(seed):
    """(name of the robot, all files) with one to three things of one file changed."""
    rng = random.Random(seed)
    name = rng.choice(list(SOUND))
    data = SOUND[name]
    for _ in range(rng.choice((1, 1, 2, 3))):
        if name.endswith((".urdf", ".xml", ".dae")) and data:
            data = in_elements(rng, data)
        elif name.endswith((".toml", ".obj")):
            data = in_lines(rng, data.decode()).encode()
        else:
            data = in_bytes(rng, data)
    robots = ("arm.urdf", "meshes.xml", "robot.toml")
    robot = READ_BY.get(name) or (rng.choice(robots) if name == "part.obj" else name)
    return robot, SOUND | {name: data}


def in_elements(rng, data):
    """An attribute or element dropped, changed, doubled, moved, or two names swapped."""
    root = etree.fromstring(data)
    elements = list(root.iter("*"))
    one, what = rng.choice(elements), rng.randrange(8)
    if what == 0 and one.attrib:
        del one.attrib[rng.choice(list(one.attrib))]
    elif what == 1 and one is not root:
        one.getparent().remove(one)
    elif what == 2 and one is not root:
        one.addnext(deepcopy(one))
    elif what == 3 and one is not root:
        root.append(one)
    elif what == 4:
        named = [element for element in elements if element.get("name")]
        if len(named) > 1:
            a, b = rng.sample(named, 2)
            first, second = a.get("name"), b.get("name")
            a.set("name", second), b.set("name", first)
    elif one.attrib:
        key = rng.choice(list(one.attrib))
        one.set(key, changed(rng, one.get(key)))
    if one.text and one.text.strip():
        one.text = changed(rng, one.text)
    return etree.tostring(root)


def in_lines(rng, text):
    """A line dropped or doubled, two swapped, or a word changed."""
    lines = text.split("\n")
    at, other, what = rng.randrange(len(lines)), rng.randrange(len(lines)), rng.randrange(6)
    if what == 0:
        del lines[at]
    elif what == 1:
        lines.insert(at, lines[at])
    elif what == 2:
        lines[at], lines[other] = lines[other], lines[at]
    else:
        lines[at] = changed(rng, lines[at])
    return "\n".join(lines)


def in_bytes(rng, data):
    """Bytes flipped, dropped, doubled, or a number that is none."""
    data, at, what = bytearray(data), rng.randrange(len(data) or 1), rng.randrange(4)
    if what == 0:
        data[at : at + 1] = bytes([rng.randrange(256)])
    elif what == 1:
        del data[at : at + rng.choice((1, 4, 50))]
    elif what == 2:
        data[at:at] = data[max(at - 20, 0) : at]
    else:
        data[at : at + 4] = rng.choice(
            (b"\xff\xff\xff\xff", b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff\xff\x7f\x7f")
        )
    return bytes(data)


def changed(rng, text):
    """Text with one of its words, or all, put in another's place."""
    words = re.split(r"(\s+|=|,|\[|\])", text)
    real = [k for k, word in enumerate(words) if word.strip() and word not in "=,[]"]
    if not real or rng.random() < 0.2:
        return rng.choice(VALUES)
    words[rng.choice(real)] = rng.choice(VALUES)
    return "".join(words)
