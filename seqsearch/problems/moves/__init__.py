"""Pieces from which problems make moves of their own."""
