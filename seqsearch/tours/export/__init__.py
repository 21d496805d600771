"""Files out: a flight in the formats that competitions, SPICE and other programs read.

To write one of your own, give a class the members of `Exporter` and name it in the entry points
``seqsearch.exports``.
"""

from seqsearch.tours.export.make import exporters, make_exporter
from seqsearch.tours.export.protocol import Exporter, Flight

__all__ = ["Exporter", "Flight", "exporters", "make_exporter"]
