"""The recording of a calibration: the arm at its poses, the errors, and where regions hold."""
