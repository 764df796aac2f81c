"""A robot identified from several visits: what each shows, and frames of its own."""
