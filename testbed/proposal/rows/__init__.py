"""Rows that a proposal is tried with, and which of two files belong together."""
