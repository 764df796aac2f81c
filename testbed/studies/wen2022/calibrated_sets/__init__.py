"""Designed sets among random ones of their size, all calibrated: played, summed up, shown."""
