"""Which observations do not fit the others, and which of them no model explains."""
