"""Frames of a session, as far as readings show them."""
