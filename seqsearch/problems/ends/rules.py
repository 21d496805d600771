"""`EndsRules`: how fast tours may begin, pass what they visit, and end."""

from typing import Annotated, Final, Literal, final

import msgspec
from msgspec import Meta

_FASTEST_KM_S: Final = 100.0
"""No launch and no arrival is faster: what is, was meant in m/s."""


@final
class EndsRules(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Free ends of legs; the ``[ends]`` table of a problem file. Speeds are relative to bodies.

    Parameters
    ----------
    launch_from : "earth", optional
        Where tours start; default: at the bodies of the table, or its `start_ids`.
    launch_vinf_km_s : float
        Largest excess speed of the first departure, in any direction and for free.
    visits : "rendezvous" or "fly-by"
        Whether bodies are visited at rest, or passed: then there is no stay, and the next leg
        begins with the velocity at which the body was passed.
    visit_vinf_km_s : float, optional
        Largest speed at which bodies are passed; default: any.
    arrival_vinf_km_s : float
        Largest speed of the arrival at the body at which tours end.
    """

    launch_from: Literal["earth"] | None = None
    launch_vinf_km_s: Annotated[float, Meta(ge=0)] = 0.0
    visits: Literal["rendezvous", "fly-by"] = "rendezvous"
    visit_vinf_km_s: Annotated[float, Meta(gt=0)] | None = None
    arrival_vinf_km_s: Annotated[float, Meta(ge=0)] = 0.0

    def __post_init__(self) -> None:
        for name in ("launch_vinf_km_s", "arrival_vinf_km_s", "visit_vinf_km_s"):
            value = getattr(self, name)
            if value is not None and not value <= _FASTEST_KM_S:
                raise ValueError(
                    f"{name} {value:g}, expected at most {_FASTEST_KM_S:g}; is it in m/s?"
                )
        if self.visits == "rendezvous" and self.visit_vinf_km_s is not None:
            raise ValueError('visit_vinf_km_s without visits = "fly-by"')
