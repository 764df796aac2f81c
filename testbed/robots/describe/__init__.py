"""Robots read from foreign files, proven before they are believed."""
