"""Our own batch solver: maximum initial mass and minimum propellant of many legs at once."""
