"""Tours with a fixed end: what the way there costs, and when a tour is complete."""
