"""The quick features, of eight legs at a time: a step is a loop over lanes, one vector to it."""
