"""From measurements to an identified model."""
