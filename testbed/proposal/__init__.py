"""Proposals that `truebed new` writes from a user's files, and what `truebed check` reads."""
