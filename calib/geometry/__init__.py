"""Frames, chains, their Jacobian and the named numbers of a robot model."""
