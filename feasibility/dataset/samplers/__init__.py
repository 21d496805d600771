"""Samplers: from which distribution the legs of a dataset are drawn."""
