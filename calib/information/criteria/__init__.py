"""What makes one pose set better than another: one criterion per file, with its exact moves."""

NEEDS_GOALS = ("V", "G")
"""Names of the criteria that ask where the tool must be right."""
