"""The order in which poses are measured, and free moves between them."""
