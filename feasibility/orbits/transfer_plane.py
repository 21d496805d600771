"""The plane and the sense of rotation of a transfer, taken from the departure orbit.

Two positions alone say neither which way round a Lambert arc should go, nor, near 0 and 180
degrees, in which plane: there the plane through both stands steeply on the orbits although
they are nearly coplanar. The departure orbit's angular momentum decides both here.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits.plane_kernels import sine_below, turns_against

_Array = NDArray[np.float64]

# Within this sine of 0 or 180 degrees the plane through both positions may mislead.
_NEAR: Final = np.sin(np.radians(10.0))
# It does where it is tilted by this much against the departure orbit: turning there and back
# costs half the orbital velocity each time, so no arc in it is of use to an electric engine.
_STEEP: Final = np.cos(np.radians(30.0))
# In a plane steeper than this cosine neither sense of rotation is of use.
_CLEARLY: Final = 0.5
_SINGULAR: Final = 1e-7
# By so much a target exactly opposite is moved: Lambert's plane is defined again.
_NUDGE_RAD: Final = 1e-5


def along_departure(rv_dep: _Array, rv_arr: _Array) -> tuple[_Array, _Array]:
    """Turn legs so that their prograde Lambert arcs go round as the departure orbit does.

    Parameters
    ----------
    rv_dep, rv_arr : (n, 6) float64
        States at departure and arrival.

    Returns
    -------
    rv_dep, rv_arr : (n, 6) float64
        The same; where a row's arcs would clearly go the other way (by less than 60 degrees
        between the planes) both states are turned alike, which leaves every mass and
        velocity change as it is.
    """
    against = np.flatnonzero(turns_against(rv_dep, rv_arr, _CLEARLY))
    if not len(against):
        return rv_dep, rv_arr
    normal, momentum = _normals(rv_dep[against], rv_arr[against])
    along = np.einsum("ij,ij->i", normal, momentum)
    rv_dep, rv_arr = rv_dep.copy(), rv_arr.copy()
    # The largest component becomes that along z, and positive where the legs turn forward.
    shift = 2 - np.abs(normal).argmax(axis=1)
    axes = (np.arange(3) - shift[:, None]) % 3
    largest = np.take_along_axis(normal, axes, axis=1)[:, 2]
    flip = np.where((largest * along < 0.0)[:, None], [1.0, -1.0, -1.0], 1.0)
    for states in (rv_dep, rv_arr):
        for part in (slice(0, 3), slice(3, 6)):
            states[against, part] = flip * np.take_along_axis(states[against, part], axes, axis=1)
    return rv_dep, rv_arr


def off_singular(rv_dep: _Array, rv_arr: _Array) -> _Array:
    """Return the arrival states, those exactly at 0 or 180 degrees moved by 1e-5 rad.

    Parameters and states as for `along_departure`; the shift is in the departure orbit's plane.
    """
    singular = np.flatnonzero(sine_below(rv_dep, rv_arr, _SINGULAR))
    return _levelled(rv_dep, rv_arr, singular) if len(singular) else rv_arr


def in_line(rv_dep: _Array, rv_arr: _Array) -> NDArray[np.bool_]:
    """Return (n,) bool, True where both positions lie in exactly the same direction.

    No arc of two impulses leads there unless both distances are equal: Lambert says nothing.
    """
    mask: NDArray[np.bool_] = sine_below(rv_dep, rv_arr, _SINGULAR)
    rows = np.flatnonzero(mask)
    mask[rows] = np.einsum("ij,ij->i", rv_dep[rows, :3], rv_arr[rows, :3]) > 0.0
    return mask


def levelled_targets(rv_dep: _Array, rv_arr: _Array, tof_s: _Array, mu: float) -> _Array:
    """Return the arrival states, those of misleading transfer planes turned into the orbit's.

    Within 10 degrees of 0 or 180 degrees, where the plane through both positions is tilted by
    more than 30 degrees against the departure orbit, the target is turned into the plane of
    that orbit, velocity included. What the small turn costs an engine that may thrust anywhere
    on the way is neglected. Near 0 degrees only legs of more than half a period are turned;
    shorter ones do go straight to the target.

    Parameters
    ----------
    rv_dep, rv_arr : (n, 6) float64, m and m/s
        States at departure and arrival.
    tof_s : (n,) float64, s
        Flight times.
    mu : float, m3/s2
        Gravitational parameter.
    """
    near = np.flatnonzero(sine_below(rv_dep, rv_arr, _NEAR))
    if not len(near):
        return rv_arr
    left, right = rv_dep[near], rv_arr[near]
    normal, momentum = _normals(left, right)
    along = np.abs(np.einsum("ij,ij->i", normal, momentum))
    size = np.linalg.norm(normal, axis=1) * np.linalg.norm(momentum, axis=1)
    opposite = np.einsum("ij,ij->i", left[:, :3], right[:, :3]) < 0.0
    # Negative on hyperbolas, which do not return.
    inverse_a = 2.0 / np.linalg.norm(left[:, :3], axis=1) - (
        np.einsum("ij,ij->i", left[:, 3:], left[:, 3:]) / mu
    )
    motion = np.sqrt(mu * np.maximum(inverse_a, 0.0) ** 3)
    misleading = (along < _STEEP * size) & (opposite | (motion * tof_s[near] > np.pi))
    misleading |= sine_below(left, right, _SINGULAR)
    return _levelled(rv_dep, rv_arr, near[misleading]) if misleading.any() else rv_arr


def _normals(rv_dep: _Array, rv_arr: _Array) -> tuple[_Array, _Array]:
    """Return r1 x r2 and the departure orbit's angular momentum, (n, 3) each."""
    return np.cross(rv_dep[:, :3], rv_arr[:, :3]), np.cross(rv_dep[:, :3], rv_dep[:, 3:])


def _levelled(rv_dep: _Array, rv_arr: _Array, rows: NDArray[np.intp]) -> _Array:
    """Return `rv_arr` with the given rows turned into the plane of the departure orbit."""
    momentum = np.cross(rv_dep[rows, :3], rv_dep[rows, 3:])
    size = np.linalg.norm(momentum, axis=1)
    # A body that falls straight has no plane.
    rows, momentum = rows[size > 0.0], momentum[size > 0.0] / size[size > 0.0, None]
    r, v = rv_arr[rows, :3], rv_arr[rows, 3:]
    radius = np.linalg.norm(r, axis=1, keepdims=True)
    radial = r / radius
    level = radial - np.einsum("ij,ij->i", radial, momentum)[:, None] * momentum
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    transverse = np.cross(momentum, level)
    across = np.cross(radial, transverse)
    parts = [np.einsum("ij,ij->i", v, axis)[:, None] for axis in (radial, transverse, across)]
    sine = np.einsum("ij,ij->i", rv_dep[rows, :3], transverse)
    singular = np.abs(sine) < _SINGULAR * np.linalg.norm(rv_dep[rows, :3], axis=1)
    nudge = np.where(singular, _NUDGE_RAD, 0.0)[:, None]
    # Towards smaller transfer angles.
    new_radial = np.cos(nudge) * level - np.sin(nudge) * transverse
    new_transverse = np.cos(nudge) * transverse + np.sin(nudge) * level
    turned = rv_arr.copy()
    turned[rows, :3] = radius * new_radial
    turned[rows, 3:] = parts[0] * new_radial + parts[1] * new_transverse + parts[2] * momentum
    return turned
