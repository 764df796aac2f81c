"""The run folder: records, arrays and manifests, each whole or not at all."""
