"""Loops over many replicates, for a few in numpy, else compiled: compiled by numba if it is there."""
