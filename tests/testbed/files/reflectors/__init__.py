"""Reflectors on one tool."""
