"""A robot program's targets in CSV: read, and corrected for the identified robot."""
