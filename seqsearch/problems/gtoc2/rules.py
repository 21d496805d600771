"""`Gtoc2Rules`: the numbers of the GTOC2 statement that other problems do not have."""

from typing import Annotated, final

import msgspec
from msgspec import Meta


@final
class Gtoc2Rules(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Launch and groups; the ``[gtoc2]`` table of a problem file.

    Parameters
    ----------
    launch_speed_max_m_s : float
        Largest hyperbolic excess speed at the Earth; its direction is free.
    group_column : str
        Column of the asteroid table that says to which group an asteroid belongs. A tour
        visits one of each group, in any order.
    """

    launch_speed_max_m_s: Annotated[float, Meta(ge=0)] = 3500.0
    group_column: Annotated[str, Meta(min_length=1)] = "group"
