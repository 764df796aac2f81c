"""What was measured, how uncertain it is, and how far a model is from it."""
