"""Uncertainty statements of a calibration, and the evidence for them."""
