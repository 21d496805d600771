"""GTOC7: main-belt asteroids, one probe or a fleet, without the mother ship."""
