"""Files, processes, compilation and the guarded import of pykep: what every floor needs."""
