"""The scenario file: core tables, strict; nothing of any study."""
