"""The reference solver: pykep's leg with pygmo's IPOPT and SLSQP, from many starts."""
