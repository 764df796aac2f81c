"""What a file must pass before anything in it is walked: its size, its text, its depth."""
