"""How far the Kepler orbits of bodies are from what their kernels say."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.orbits.catalogue import Catalogue
from feasibility.orbits.spk.coverage import Interval
from feasibility.orbits.spk.dates import Calendar, seconds_of
from feasibility.orbits.spk.motion import Piece, States, states_at

ERROR_KM: Final = "kepler_error_km"
"""Column of a catalogue's `extra`: the largest error in position of the Kepler orbit against the
kernel, over the mission's window, or within five years of the epoch where there is none."""

ERROR_M_S: Final = "kepler_error_m_s"
"""The same for the velocity."""

_STEP_S: Final = DAY_S
_FAR_KM: Final = 1000.0
"""Miss at an arrival that competitions allow."""


def kepler_error(
    pieces: Sequence[Piece],
    states: States,
    spans: Sequence[Interval],
    epoch: float,
    state: NDArray[np.float64],
) -> tuple[float, float]:
    """Return the largest errors, m and m/s, of the Kepler orbit through a (1, 6) state.

    They are looked for once a day over the spans.
    """
    # numba takes a third of a second to import.
    from feasibility.orbits.kepler_kernels import propagate_batch

    epochs = np.concatenate(
        [np.linspace(start, end, max(2, int((end - start) / _STEP_S) + 1)) for start, end in spans]
        or [np.array([epoch])]
    )
    moved = propagate_batch(np.repeat(state, len(epochs), axis=0), epochs - epoch, MU_SUN)
    off = moved - states_at(pieces, states, epochs)
    return (
        float(np.linalg.norm(off[:, :3], axis=1).max()),
        float(np.linalg.norm(off[:, 3:], axis=1).max()),
    )


def motion_line(catalogue: Catalogue) -> str | None:
    """Return in words how the bodies move and what Kepler orbits are off; None without kernels."""
    if ERROR_KM not in catalogue.extra:
        return None
    error_km, error_m_s = catalogue.extra[ERROR_KM], catalogue.extra[ERROR_M_S]
    worst = int(np.argmax(error_km))
    size = (
        f"{error_km[worst]:.3g} km ({error_km[worst] * 1e3 / AU:.2g} AU) and "
        f"{error_m_s.max():.3g} m/s off, {catalogue.names[worst]} the most"
    )
    if catalogue.ephemeris is not None:
        return f"bodies move as the kernels say; Kepler orbits would be up to {size}"
    epoch = Calendar().text(seconds_of(float(np.median(catalogue.epoch_mjd2000))))
    line = f"bodies move on Kepler orbits of {epoch}, against the kernels up to {size}"
    if error_km[worst] > _FAR_KM:
        line += '; [catalogue] ephemeris = "spk" moves them as the kernels say'
    return line
