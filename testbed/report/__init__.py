"""The page and its pictures, for every verb."""
