"""What a person should do after a calibration."""
