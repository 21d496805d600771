"""Quick features of eight legs at a time: every step is a loop over lanes, one vector to the CPU."""
