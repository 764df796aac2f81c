"""Drafts of a session held against a nominal robot: which fits, and which positions count."""
