"""Uncertainty statements of many robots at once, robots on the first axis of every array."""
