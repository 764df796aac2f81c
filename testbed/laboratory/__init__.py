"""The true robot, the tracker, the feasible poses."""
