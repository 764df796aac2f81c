"""The virtual laser tracker: what it shows, where it stands, what it gets wrong."""
