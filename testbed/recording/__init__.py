"""The file that Rerun plays: cells, charts, layouts and stories, for every verb."""
