"""Files of a robot's owner with corrected frames, and nothing else in them changed."""
