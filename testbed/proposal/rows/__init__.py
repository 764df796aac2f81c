"""Rows with which a proposal is tried, and matching of rows in two files."""
