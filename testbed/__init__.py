"""The virtual laboratory and its command."""
