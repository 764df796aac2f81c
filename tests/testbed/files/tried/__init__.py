"""Other interpretations of a file."""
