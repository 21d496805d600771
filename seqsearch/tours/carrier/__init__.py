"""A carrier with craft: a mother ship with impulses that releases and catches low-thrust probes.

`records` has the flight as data, `path` flies it, `carrier_files` has its JSON; `rows` writes the
files to hand in, and `verify` checks them without any of those. This package imports nothing, so
that the verification shares nothing with the rest.
"""
