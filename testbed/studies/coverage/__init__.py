"""Many robots of several kinds: which stated uncertainty holds the true error."""
