"""A chart of legs between near bodies, and beams that look everything up on it."""
