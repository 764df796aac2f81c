"""Drift: whether residuals in time order resemble their neighbors, and what that leaves."""
