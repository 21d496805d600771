"""Tour events: what rules allow beyond legs from rest to rest, one kind a file.

| kind | what happens |
|---|---|
| `Launch` | the tour begins at a planet with an excess speed |
| `FlyBy` | a body met before is passed once more |
| `Drop` | something is left behind at each body |
| `Groups` | one body of each group is visited |

Another package brings a kind of its own through the entry points `seqsearch.events`.
"""

from seqsearch.tours.events.drop import Drop
from seqsearch.tours.events.fly_by import FlyBy
from seqsearch.tours.events.groups import Groups
from seqsearch.tours.events.launch import Launch
from seqsearch.tours.events.make import event_kinds, make_event
from seqsearch.tours.events.protocol import TourEvent

__all__ = ["Drop", "FlyBy", "Groups", "Launch", "TourEvent", "event_kinds", "make_event"]
