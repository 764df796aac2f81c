"""The verb `iso9283`: pose, distance and path figures of a real robot from measured cycles."""
