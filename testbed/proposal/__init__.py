"""What `truebed new` writes and `truebed check` reads: proposals from the files that are there."""
