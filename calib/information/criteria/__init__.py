"""Optimality criteria of pose sets, each with the exact gains of adding, dropping and swapping."""

NEEDS_GOALS = ("V", "G")
"""Names of the criteria that need goal poses, where the tool must be right."""
