"""Designed pose sets against random ones on many robots."""
