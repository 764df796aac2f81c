"""Initial values of arms for which the usual closed forms are not enough."""
