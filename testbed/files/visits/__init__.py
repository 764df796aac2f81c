"""Several visits of one robot: [[session]] of session.toml."""
