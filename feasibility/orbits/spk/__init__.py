"""SPK kernels: bodies whose motion NAIF's, JPL's or a mission's files say, read by spiceypy.

`feasibility.orbits.spk.reading.read_kernels` makes a catalogue of them. Nothing is imported here:
`Catalogue` itself uses a part of the room.
"""
