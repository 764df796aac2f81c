"""Directions and ranges of an instrument: which columns they are, and how they are meant."""
