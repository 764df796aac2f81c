"""The secret: geometry, joint errors, springs and backlash of the true robot."""
