"""The verb that plays a whole virtual campaign."""
