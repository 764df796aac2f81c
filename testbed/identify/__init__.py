"""The verb that calibrates a real robot from measurement files."""
