"""What to believe of a calibration, and why."""
