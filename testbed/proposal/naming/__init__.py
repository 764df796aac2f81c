"""Names of columns: in small words, of joints, of targets, and of positions beside rotations."""
