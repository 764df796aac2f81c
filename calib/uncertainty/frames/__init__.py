"""In which frame readings stand, and which one tool points are stated in."""
