"""Scouting: cheap beams of predicted legs that tell where full optimisations are worth it."""
