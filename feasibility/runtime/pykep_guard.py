"""The one place that imports pykep.

Three defects of the pykep 3.0.1 wheel are contained here, so that the rest of
the project can use pykep without knowing about them:

1. ``import pykep`` fails, because the wheel lacks the data files that
   ``pykep.trajopt.gym`` reads when imported (esa/pykep issue 217).
2. The wheel carries its own libheyoka, loaded with ``RTLD_GLOBAL``, and then
   imports the package ``heyoka``, which carries a second copy. Symbols of one
   are interposed by the other, static objects are destroyed twice, and about
   one process in ten aborts at interpreter exit after correct results.
3. Importing it sets numpy's print options to ``legacy="1.13"``.

The cure for 1 and 2 is to import pykep while empty modules stand in for
``heyoka`` and ``pykep.trajopt``. What is lost, pykep's zero-order-hold leg and
its ready-made problems, is not used by this project. Programs that need them import
pykep before they use anything of this project that does: their pykep is left alone.
"""

import functools
import importlib
import importlib.util
import sys
import types
import warnings
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any, final

import numpy as np

from feasibility.errors import MissingDependencyError

_STAND_INS = ("heyoka", "pykep.trajopt")
_LEFT_OUT = (
    "pykep.trajopt is not there: feasibility imported pykep without it, because pykep's wheel and "
    "heyoka's cannot share a process safely; import pykep before you use feasibility to have it"
)


@functools.cache
def load_pykep() -> Any:
    """Return the pykep module, imported safely.

    Returns
    -------
    module
        pykep, with ``leg.sims_flanagan``, ``lambert_problem``, ``mima``,
        ``planet``, ``udpla`` and ``knn``. If the caller's program imported
        pykep before, that very module, untouched.

    Raises
    ------
    MissingDependencyError
        pykep is not installed, is broken in a way unknown here, or its wheel
        cannot be loaded any more because ``heyoka`` was imported first.

    Warns
    -----
    RuntimeWarning
        Once, if pykep's wheel was already imported in full, together with the
        second libheyoka that can abort the process at exit.
    """
    already = sys.modules.get("pykep")
    if already is not None:
        if "heyoka" in sys.modules and _bundles_heyoka():
            warnings.warn(
                "pykep was imported before feasibility: two copies of libheyoka are loaded and "
                "the process may abort at exit; import feasibility first to avoid it",
                RuntimeWarning,
                stacklevel=2,
            )
        return already
    if importlib.util.find_spec("pykep") is None:
        raise MissingDependencyError(
            "pykep is not installed; install it with: pip install 'pykep>=3.0.1,<4'"
        )
    print_options = np.get_printoptions()
    try:
        return _import_with_stand_ins() if _bundles_heyoka() else importlib.import_module("pykep")
    except MissingDependencyError:
        raise
    except Exception as error:
        raise MissingDependencyError(
            f"pykep is installed but cannot be imported ({type(error).__name__}: {error}); "
            "reinstall it with: pip install --force-reinstall 'pykep>=3.0.1,<4'"
        ) from error
    finally:
        np.set_printoptions(**print_options)


def _bundles_heyoka() -> bool:
    """Tell whether pykep comes as a wheel with a libheyoka of its own."""
    spec = importlib.util.find_spec("pykep")
    if spec is None or spec.origin is None:
        return False
    package = Path(spec.origin).parent
    folders = (package.parent / "pykep.libs", package / ".dylibs")
    return any(True for folder in folders for _ in folder.glob("libheyoka*"))


def _import_with_stand_ins() -> Any:
    if "heyoka" in sys.modules:
        raise MissingDependencyError(
            "heyoka was imported before pykep: their wheels carry two copies of libheyoka and "
            "loading both crashes; import feasibility before heyoka"
        )
    stand_ins = {name: types.ModuleType(name) for name in _STAND_INS}
    stand_ins["pykep.trajopt"].__dict__["mim_from_hop"] = _not_available
    sys.modules.update(stand_ins)
    try:
        pykep = importlib.import_module("pykep")
    finally:
        # Whoever asks for the real modules later should get them, not our empty ones.
        for name in _STAND_INS:
            if sys.modules.get(name) is stand_ins[name]:
                del sys.modules[name]
    if pykep.__dict__.get("trajopt") is stand_ins["pykep.trajopt"]:
        del pykep.trajopt
        pykep.__dict__["__getattr__"] = _missing_attribute
        sys.meta_path.insert(0, _NoTrajopt())
    return pykep


def _missing_attribute(name: str) -> None:
    if name == "trajopt":
        raise AttributeError(_LEFT_OUT)
    raise AttributeError(f"module 'pykep' has no attribute {name!r}")


@final
class _NoTrajopt(MetaPathFinder):
    """Says why `import pykep.trajopt` fails; the import itself ends in an obscure TypeError."""

    def find_spec(self, fullname: str, _path: object = None, _target: object = None) -> None:
        """Refuse the one module."""
        if fullname == "pykep.trajopt":
            raise ImportError(_LEFT_OUT, name=fullname)


def _not_available(*_args: object, **_kwargs: object) -> None:
    raise MissingDependencyError(
        "this part of pykep needs heyoka, which pykep's wheel cannot share a process with"
    )
