"""Robots in files of others, written by hand in their manner with numbers of our own."""

import struct

import numpy as np

LINK = """  <link name="{name}">
    <inertial>
      <origin xyz="{center}" rpy="0 0 0"/>
      <mass value="{mass}"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/>
    </inertial>{more}
  </link>
"""
JOINT = """  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin xyz="{xyz}" rpy="{rpy}"/>
    <axis xyz="{axis}"/>
    {limit}
  </joint>
"""
LIMIT = '<limit lower="{}" upper="{}" effort="100" velocity="2.5"/>'


def urdf(name, joints, *, bare=(), more="", parts=None):
    """A URDF of links in a row: joints are (name, kind, xyz, rpy, axis, limits)."""
    parts = parts or {}
    text = [f'<?xml version="1.0"?>\n<robot name="{name}">\n  <link name="base_link"/>\n']
    parent = "base_link"
    for joint, kind, xyz, rpy, axis, limits in joints:
        child = f"{joint}_link"
        if joint in bare or kind == "fixed":
            text.append(f'  <link name="{child}">{parts.get(joint, "")}</link>\n')
        else:
            text.append(
                LINK.format(name=child, center="0 0 0.1", mass=2.0, more=parts.get(joint, ""))
            )
        text.append(
            JOINT.format(
                name=joint,
                kind=kind,
                parent=parent,
                child=child,
                xyz=xyz,
                rpy=rpy,
                axis=axis,
                limit=LIMIT.format(*limits) if limits else "",
            )
        )
        parent = child
    return "".join([*text, more, "</robot>\n"])


TURN = (-3.1, 3.1)
HALF = repr(np.pi / 2)
UR_LIKE = urdf(
    "collaborative six",
    [
        ("inertia", "fixed", "0 0 0", f"0 0 {np.pi!r}", "1 0 0", None),
        ("pan", "revolute", "0 0 0.131", "0 0 0", "0 0 1", (-6.2, 6.2)),
        ("lift", "revolute", "0 0.21 0", f"0 {HALF} 0", "0 1 0", TURN),
        ("elbow", "revolute", "0 -0.16 0.605", "0 0 0", "0 1 0", TURN),
        ("wrist_1", "revolute", "0 0.001 0.57", f"0 {HALF} 0", "0 1 0", TURN),
        ("wrist_2", "revolute", "0 0.118 0", "0 0 0", "0 0 1", TURN),
        ("wrist_3", "continuous", "0 0 0.117", "0 0 0", "0 1 0", None),
        ("flange", "fixed", "0 0.09 0", f"0 0 {HALF}", "1 0 0", None),
        ("tool0", "fixed", "0 0 0", f"{HALF} 0 {HALF}", "1 0 0", None),
    ],
)
IIWA_LIKE = urdf(
    "seven",
    [
        (f"a{i + 1}", "revolute", f"0 {y} {z}", f"{r} 0 0", "0 0 1", TURN)
        for i, (y, z, r) in enumerate(
            [
                (0, 0.15, 0),
                (0, 0.19, HALF),
                (0.21, 0, f"-{HALF}"),
                (0, 0.19, f"-{HALF}"),
                (-0.21, 0, HALF),
                (0.06, 0.19, HALF),
                (0.081, 0.06, f"-{HALF}"),
            ]
        )
    ]
    + [("ee", "fixed", "0 0 0.045", "0 0 0", "1 0 0", None)],
)
SCARA = urdf(
    "scara",
    [
        ("j1", "revolute", "0 0 0.4", "0 0 0", "0 0 1", TURN),
        ("j2", "revolute", "0.325 0 0.05", "0 0 0", "0 0 1", (-2.6, 2.6)),
        ("quill", "prismatic", "0.225 0 -0.02", "0 0 0", "0 0 -1", (0, 0.2)),
        ("spin", "revolute", "0 0 -0.15", "0 0 0", "0 0 -1", (-6.2, 6.2)),
    ],
)
GANTRY = urdf(
    "gantry",
    [
        ("x", "prismatic", "0 0 2.5", "0 0 0", "1 0 0", (0, 4)),
        ("y", "prismatic", "0 0.2 0", "0 0 0", "0 1 0", (0, 2)),
        ("z", "prismatic", "0.1 0 -0.3", "0 0 0", "0 0 -1", (0, 1)),
        ("w1", "revolute", "0 0 -0.4", "0 0 0", "0 0 1", TURN),
        ("w2", "revolute", "0 0.1 0", "0 0 0.1", "0 1 0", TURN),
        ("w3", "revolute", "0 0 -0.1", "0 0 0", "0 0 1", TURN),
        ("tip", "fixed", "0 0 -0.12", f"{np.pi!r} 0 0", "1 0 0", None),
    ],
)
ARMS = {"ur": UR_LIKE, "iiwa": IIWA_LIKE, "scara": SCARA, "gantry": GANTRY}

MJCF = """<mujoco model="Bench Arm">
  <compiler angle="degree" eulerseq="XYZ" meshdir="assets"/>
  <default>
    <joint axis="0 1 0" range="-120 120"/>
    <default class="wide"><joint range="-170 170"/></default>
    <default class="hull"><geom group="3" type="box" size=".05 .05 .05" rgba="1 0 0 1"/></default>
  </default>
  <asset>
    <mesh name="block" file="block.stl" scale="0.001 0.001 0.001"/>
    <material name="blue" rgba="0.1 0.2 0.8 1"/>
  </asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="column" pos="0.2 0 0.1" euler="0 0 30">
      <geom type="mesh" mesh="block" material="blue" contype="0" conaffinity="0"/>
      <geom class="hull"/>
      <body name="upper" pos="0 0 0.3">
        <inertial pos="0 0 0.1" mass="4" diaginertia="0.03 0.03 0.01"/>
        <joint name="pan" class="wide" axis="0 0 1"/>
        <joint name="lift" pos="0 0 0.05" ref="20"/>
        <geom type="mesh" mesh="block" pos="0 0 0.1" euler="10 20 30" material="blue"/>
        <body name="fore" pos="0 0.02 0.5" quat="0.9238795325112867 0 0.3826834323650898 0">
          <inertial pos="0 0 0.1" mass="2" diaginertia="0.02 0.02 0.01"/>
          <joint name="elbow"/>
          <body name="sled" pos="0.1 0 0.2">
            <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
            <joint name="reach" type="slide" axis="0.6 0 0.8" range="0 0.3"/>
            <body name="hand" pos="0 0 0.2">
              <inertial pos="0 0 0" mass="0.5" diaginertia="0.001 0.001 0.001"/>
              <joint name="twist" axis="0 0 1" limited="false"/>
              <site name="grip" pos="0.01 0 0.1" euler="180 0 0"/>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position joint="pan"/><position joint="lift"/><motor joint="elbow"/>
    <position joint="reach"/><position joint="twist"/>
  </actuator>
  <keyframe><key name="home" qpos="0 0 0 0 0"/></keyframe>
</mujoco>
"""


def stl(vertices, faces, *, claimed=None):
    """A binary STL of vertices (v, 3) and faces (f, 3)."""
    head = b"\0" * 80 + struct.pack("<I", len(faces) if claimed is None else claimed)
    corners = (np.ravel(np.take(vertices, face, axis=0)) for face in faces)
    return head + b"".join(struct.pack("<12fH", 0, 0, 0, *corner, 0) for corner in corners)


CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
SIDES = [
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
]  # fmt: skip


def block(size=(1.0, 1.0, 1.0), corner=(0.0, 0.0, 0.0)):
    """A box as a binary STL."""
    return stl(CORNERS * size + corner, SIDES)


def bench_arm(folder, text=MJCF):
    """The MJCF with its mesh in millimetres, in a folder; its path."""
    (folder / "assets").mkdir(exist_ok=True)
    (folder / "assets" / "block.stl").write_bytes(block((80.0, 60.0, 100.0), (-40.0, -30.0, 0.0)))
    (folder / "arm.xml").write_text(text, encoding="utf-8")
    return folder / "arm.xml"
