"""The report of a calibration: its page, section by section, and its plots."""
