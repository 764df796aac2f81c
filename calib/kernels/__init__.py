"""Loops over many replicates, for a few in numpy, else compiled: the only room that knows numba."""
