"""Robot calibration as estimation on arrays: numpy and scipy only, no files, no simulator."""
