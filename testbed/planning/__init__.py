"""The plan of a real measurement: goal, pose set, order, readings and what will come out."""
