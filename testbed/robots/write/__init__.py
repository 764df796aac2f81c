"""Robots written: robot.toml, URDF, MJCF and the table of numbers."""
