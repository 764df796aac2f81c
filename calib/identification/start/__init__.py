"""Base, tool and fixtures found from the measurements alone."""
