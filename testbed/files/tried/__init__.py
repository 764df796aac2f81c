"""Interpretations of a file: what each leaves, of arms near nominal and far from it."""
