"""Loops over many replicates: numpy for a few, compiled by numba for many, where it is there."""
