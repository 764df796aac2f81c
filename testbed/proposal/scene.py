"""A scenario for a robot: a short campaign, each table with its reason."""

from testbed.robots.file_frames import chain_words
from testbed.robots.robot import Robot, workspace
from testbed.toml_text import toml_value

SCENE = """\
# Proposed by truebed new scene for {title}
# Play it: truebed run FILE. Plan a real measurement with it: see the end
# All other keys and their defaults: truebed scenes quick
format = 1
name = {name}
title = {about}
seed = 1  # of every random number
robot = {robot}

[truth]  # the secret robot: "rigid" has other link numbers only; see truebed scenes
preset = "rigid"

[tracker]  # the instrument: noise and systematic errors of its data sheet
preset = "at960"
systematic = true  # what more poses do not lower: range, encoders, target, level
# acceptance_deg = 60.0  # how far a 6-D probe may look away from the tracker; asked before a plan
station_mm = {station}  # where its beam starts, base frame: {origin}
{base}
[pool]  # candidate poses in a box where the robot works
size = 300
box_center_mm = {center}
box_size_mm = {size}
{ranges}
[test]  # poses never used, on which all is judged
poses = 50

[[trial]]  # one pose set that is chosen, measured and calibrated from
name = "designed-{poses}"
poses = {poses}
method = "detmax"
criterion = "O1"

[[trial]]
name = "random-{poses}"
poses = {poses}
method = "random"

# For a real robot: remove "# " from the next three lines, then type truebed plan FILE
# [plan]
# poses = {poses}
# held_out = 20  # poses that check the calibration afterwards
"""
RANGES = "joint_ranges_deg = {ranges}  # of candidates: some joints may turn farther\n"
BASE = "# base frame: on the first joint axis, {stands}\n"
PER_JOINT = 5
"""Poses of a set for each joint: some more than the numbers of a chain need."""


def scene_text(robot: Robot, named: str, name: str) -> str:
    """The text of a scenario; `named` is how its file names the robot."""
    place = workspace(robot)
    ranges = [list(pair) for pair in place.joint_ranges_deg]
    return SCENE.format(
        title=robot.title,
        name=toml_value(name),
        about=toml_value(f"{robot.title[:100]}: what a calibration would bring"),
        robot=toml_value(named),
        station=list(place.station_mm),
        base=BASE.format(stands=stands) if (stands := chain_words(robot)) else "",
        origin="as the robot's file says" if robot.workspace else "derived from its reach",
        center=list(place.box_center_mm),
        size=list(place.box_size_mm),
        ranges=RANGES.format(ranges=ranges) if ranges else "",
        poses=max(PER_JOINT * robot.model.chain.n_joints, 20),
    )
