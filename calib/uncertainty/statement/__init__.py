"""What may be said of a tool point: how far, with which probability, and whether it conforms."""
