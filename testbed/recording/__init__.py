"""The file that Rerun plays: cells, curves, layouts and stories, for every verb."""
