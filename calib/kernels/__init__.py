"""Compiled loops that numpy cannot reach; the only room that knows numba."""
