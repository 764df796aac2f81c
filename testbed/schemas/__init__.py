"""The schemas of all TOML files, in words and as JSON Schema for editors."""
