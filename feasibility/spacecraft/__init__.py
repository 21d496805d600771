"""A spacecraft of one's own: is the default model good enough for it, and a model that is."""
