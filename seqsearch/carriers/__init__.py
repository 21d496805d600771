"""A carrier and its craft together: which orbits a mother ship uses, and the tours of her probes.

`plans` has what is screened, `homing` the beams that do it, `crew` the tours of all probes,
`flight` the mother ship's events, and `campaign` the stages of a search.
"""
