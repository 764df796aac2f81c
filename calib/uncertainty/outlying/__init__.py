"""What stands out of the readings: held-out poses, and measured angles."""
