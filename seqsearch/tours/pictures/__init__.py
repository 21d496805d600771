"""Pictures of tours, and what tells their numbers: see `plots`."""
