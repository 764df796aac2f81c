"""Measurement files in and out: tables and conventions of many programs, one `Session` inside."""
