"""Where bodies are as SPICE says it, for the verification: no table in between.

SPICE evaluates each segment itself; what is done here is to go from centre to centre until the
Sun is reached.
"""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from feasibility.runtime.spice import opened, spice
from seqsearch.tours.motion import body_state
from seqsearch.tours.records import KernelFile, TourBody
from seqsearch.tours.tour import TourRules

_SUN: Final = 10
_BARYCENTRE: Final = 0
_ROUNDING_S: Final = 0.01
"""Ends of segments that follow each other are this far apart at most."""

_LONGEST_CHAIN: Final = 10


def missing_kernels(kernels: Sequence[KernelFile], files: Sequence[Path]) -> list[str]:
    """Return the names of kernels whose very content is in none of the files."""
    there = {_sha256(file) for file in files if file.is_file()} if kernels else set()
    return [kernel.name for kernel in kernels if kernel.sha256 not in there]


@final
class KernelStates:
    """States of the bodies of opened kernels; see `kernel_states`."""

    def __init__(self, handles: Sequence[tuple[Path, int]]) -> None:
        self._segments: list[tuple[int, int, NDArray[np.float64], float, float]] = []
        with spice() as spiceypy:
            for _, handle in handles:
                spiceypy.dafbfs(handle)
                while spiceypy.daffna():
                    descriptor = np.array(spiceypy.dafgs()[:5])
                    times, numbers = spiceypy.dafus(descriptor, 2, 6)
                    self._segments.append(
                        (int(numbers[0]), handle, descriptor, float(times[0]), float(times[1]))
                    )

    def __call__(self, body: int, t_mjd2000: float) -> NDArray[np.float64]:
        """Return the (6,) state of a body about the Sun in the J2000 ecliptic, m and m/s.

        Raises
        ------
        InputError
            The kernels do not have it at that epoch.
        """
        seconds = (t_mjd2000 - 0.5) * DAY_S
        total = np.zeros(6)
        with spice() as spiceypy:
            for _ in range(_LONGEST_CHAIN):
                if body == _SUN:
                    return 1e3 * total
                if body == _BARYCENTRE:
                    state, centre = self._relative(spiceypy, _SUN, seconds)
                    total -= state
                    body = _SUN if centre == _BARYCENTRE else centre
                else:
                    state, body = self._relative(spiceypy, body, seconds)
                    total += state
        raise InputError(f"kernels: body {body} does not lead to the Sun")

    def _relative(
        self, spiceypy: Any, body: int, seconds: float
    ) -> tuple[NDArray[np.float64], int]:
        """Return the state of a body in km and km/s, and the centre that it is relative to."""
        # The last segment counts, as in SPICE.
        for number, handle, descriptor, start, end in reversed(self._segments):
            if number == body and start - _ROUNDING_S <= seconds <= end + _ROUNDING_S:
                inside = min(max(seconds, start), end)
                frame, state, centre = spiceypy.spkpvn(handle, descriptor, inside)
                turn = spiceypy.sxform(spiceypy.frmnam(frame), "ECLIPJ2000", inside)
                state = turn @ np.asarray(state)
                state[:3] += state[3:] * (seconds - inside)
                return state, int(centre)
        t_mjd2000 = seconds / DAY_S + 0.5
        raise InputError(f"kernels: body {body} is not covered at {t_mjd2000:.3f} MJD2000")


@contextmanager
def kernel_states(files: Sequence[Path]) -> Iterator[KernelStates]:
    """Yield what has the states of the bodies of kernels; the files are closed at the end.

    Raises
    ------
    InputError
        A kernel cannot be read.
    """
    with ExitStack() as stack:
        handles = [(file, stack.enter_context(opened(file))) for file in files]
        yield KernelStates(handles)


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


BodyState = Callable[[TourBody, float], NDArray[np.float64]]
"""The (6,) state of a body at an epoch in MJD2000, m and m/s."""


@contextmanager
def states_by_rules(rules: TourRules, kernels: Sequence[Path]) -> Iterator[BodyState]:
    """Yield where bodies are by the rules of a problem: on Kepler orbits, or as kernels say.

    Raises
    ------
    InputError
        The rules name kernels that are not at hand, or that cannot be read.
    """
    if not rules.kernels:
        yield lambda body, t_mjd2000: body_state(body, t_mjd2000, rules.mu_m3_s2)
        return
    missing = missing_kernels(rules.kernels, kernels)
    if missing:
        raise InputError(
            f"the bodies of {rules.name} move as kernels say that are missing or changed: "
            f"{', '.join(missing)}; expected these very files, without which nothing is checked"
        )
    with kernel_states(kernels) as states:
        yield lambda body, t_mjd2000: states(body.id, t_mjd2000)
