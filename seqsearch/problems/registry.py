"""Problems as plug-ins, found by the entry points ``seqsearch.problems``.

A plug-in is a package with problem files (``*.toml``). If TOML alone cannot say its rules, its
``__init__`` also offers ``RULES``, a frozen `msgspec.Struct`, and ``build(base, rules)``, which
returns a `Problem`. The name of the entry point is then the name of the table in problem files
that has the rules. Such a problem file has no ``sequence``, ``end_id``, ``must_visit`` and
``[[bodies]]`` but those that ``MISSION_KEYS`` of the ``__init__`` names. If a carrier with craft
flies one of its problems, ``CARRIERS`` has a function for the name of that problem, which returns
its `CarrierRules`. Importing the package should cost little: all plug-ins are imported whenever a
problem file is read.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata, resources
from typing import Any, Final, final

import msgspec

from feasibility import InputError
from seqsearch.core.problem import Problem
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.tours.carrier.records import CarrierRules

ENTRY_POINTS: Final = "seqsearch.problems"
"""Group of the entry points."""

Build = Callable[[RendezvousProblem, Any], Problem]
"""Makes a problem from what all problem files have, and the plug-in's own rules."""


@final
@dataclass(frozen=True)
class ProblemPlugin:
    """One plug-in.

    Attributes
    ----------
    name : str
        Name of the entry point, and of the table with the rules.
    rules : type or None
        Struct of that table; None where the plug-in has only files.
    build : callable or None
        Makes the problem.
    files : dict of str to str
        Its problem files: names of problems and TOML texts.
    carriers : dict of str to callable
        The rules of problems that a carrier flies, by the names of the problems.
    mission_keys : tuple of str
        Which of ``sequence``, ``end_id``, ``must_visit`` and ``bodies`` a problem file may have
        beside the table with the rules.
    """

    name: str
    rules: type[Any] | None
    build: Build | None
    files: dict[str, str]
    carriers: dict[str, Callable[[], CarrierRules]] = field(default_factory=dict)
    mission_keys: tuple[str, ...] = ()


@cache
def plugins() -> dict[str, ProblemPlugin]:
    """Return all plug-ins by name.

    Raises
    ------
    InputError
        A plug-in cannot be imported, has rules and no way to build a problem or the other way
        round, rules that are no struct, or a name that occurs twice or cannot be that of a table.
    """
    # The same entry may be there twice: of an installation and of a source tree beside it.
    group = metadata.entry_points(group=ENTRY_POINTS)
    entries = {(entry.name, entry.value): entry for entry in group}
    found: dict[str, ProblemPlugin] = {}
    for (name, _), entry in sorted(entries.items()):
        if name in found:
            raise InputError(f"problem plug-in {name}: two installed packages bring one")
        found[name] = _loaded(entry)
    return found


def builtin_problems() -> dict[str, str]:
    """Return the names of the problems that plug-ins bring, and their TOML texts.

    Raises
    ------
    InputError
        As `plugins`, or two plug-ins have a problem of the same name.
    """
    texts: dict[str, str] = {}
    for plugin in plugins().values():
        for name, text in plugin.files.items():
            if name in texts:
                raise InputError(f"problem {name}: two installed plug-ins have one")
            texts[name] = text
    return dict(sorted(texts.items()))


def is_carried(name: str) -> bool:
    """Tell whether a carrier flies a problem.

    Raises
    ------
    InputError
        As `plugins`.
    """
    return any(name in plugin.carriers for plugin in plugins().values())


def carrier_rules(name: str) -> CarrierRules:
    """Return the rules of a problem that a carrier flies.

    Raises
    ------
    InputError
        As `plugins`, or no plug-in has one of that name.
    """
    known = {
        name: rules for plugin in plugins().values() for name, rules in plugin.carriers.items()
    }
    if name not in known:
        raise InputError(
            f"problem {name}: not one that a carrier flies, expected {', '.join(sorted(known))}"
        )
    return known[name]()


def _loaded(entry: metadata.EntryPoint) -> ProblemPlugin:
    label = f"problem plug-in {entry.name}"
    if not entry.name.isidentifier():
        raise InputError(f"{label}: expected a name of letters, digits and underscores")
    try:
        module = entry.load()
        folder = resources.files(module.__name__)
        files = {
            file.name.removesuffix(".toml"): file.read_text(encoding="utf-8")
            for file in folder.iterdir()
            if file.name.endswith(".toml")
        }
    except Exception as error:
        raise InputError(
            f"{label}: {entry.value} cannot be loaded ({type(error).__name__}: {error})"
        ) from error
    rules, build = getattr(module, "RULES", None), getattr(module, "build", None)
    if (rules is None) != (build is None):
        raise InputError(f"{label}: {entry.value} has one of RULES and build, expected both")
    if rules is not None and not (isinstance(rules, type) and issubclass(rules, msgspec.Struct)):
        raise InputError(f"{label}: RULES of {entry.value} is no msgspec.Struct")
    return ProblemPlugin(
        entry.name,
        rules,
        build,
        files,
        dict(getattr(module, "CARRIERS", {})),
        tuple(getattr(module, "MISSION_KEYS", ())),
    )
