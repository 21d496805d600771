"""Readers of asteroid tables: one file a format, found by content."""
