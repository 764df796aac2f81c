"""The register of studies: names only; one is imported when it is asked for."""
