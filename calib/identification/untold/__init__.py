"""Numbers that readings tell barely or not at all: what a weak prior holds, and saddles."""
