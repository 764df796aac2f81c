"""Meshes read, and solids drawn."""
