"""The verb that plans a real measurement."""
