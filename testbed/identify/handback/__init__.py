"""What a calibration hands back: the robot, its numbers and files, and the tool in use."""
