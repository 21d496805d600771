"""Keys of problem files of version 0.1, and where they are now."""

from typing import Any, Final

from feasibility import InputError

_MOVED: Final = {
    "frontier": ("frontier", "kind"),
    "slice_days": ("frontier", "slice_days"),
    "nominal_visits": ("frontier", "nominal_visits"),
    "max_per_parent": ("frontier", "max_per_parent"),
    "max_per_cell": ("frontier", "max_per_cell"),
    "cell_days": ("frontier", "cell_days"),
    "max_start_share": ("frontier", "max_start_share"),
    "scout_generations": ("scouts", "generations"),
    "scout_share": ("scouts", "share"),
    "scout_width": ("scouts", "width"),
    "audit_per_rank": ("audit", "per_rank"),
}
"""Keys of ``[search]`` in files of version 0.1, and where they are now."""


def upgraded_search(search: dict[str, Any], label: str) -> dict[str, Any]:
    """Return a table ``[search]`` with the keys of version 0.1 where they are now."""
    upgraded = {
        key: value for key, value in search.items() if key not in _MOVED or isinstance(value, dict)
    }
    for key in search.keys() - upgraded.keys():
        table, name = _MOVED[key]
        inner = dict(upgraded.get(table, {}))
        if name in inner:
            raise InputError(
                f"{label}: [search] has {key!r} of version 0.1 and [search.{table}] {name!r}, "
                "expected the second alone"
            )
        upgraded[table] = inner | {name: search[key]}
    return upgraded
