"""What was seen, how uncertain it is, and how far a model is from it."""
