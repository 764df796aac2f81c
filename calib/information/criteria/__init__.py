"""What makes one pose set better than another: one criterion per file, with its exact moves."""
