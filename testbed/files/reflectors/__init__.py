"""Reflectors on one tool: whether they can be, and files of one of them each."""
