"""Finding the page's package, which this package runs but does not import otherwise.

In a checkout it is the folder ``app`` beside this package; a wheel holds it as ``symgrasp_app``.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from symgrasp.errors import SymgraspError

__all__ = ["page_module", "page_package"]

_FOLDER = Path(__file__).resolve().parent.parent
_NAME = "symgrasp_app" if (_FOLDER / "symgrasp_app").is_dir() else "app"


def page_package() -> str:
    """Return the name under which the page's package can be imported.

    What else is named ``app`` is passed by: if the path leads there first, the folder of the page comes
    before it from now on. The processes that the page starts get this path and import the page again.

    Raises:
        SymgraspError: the page is not installed, or another package of its name is imported already.
    """
    if not _is_ours():
        sys.path.insert(0, str(_FOLDER))
        if not _is_ours():
            del sys.path[0]
            raise SymgraspError(f"the package of the page is not installed, or another {_NAME!r} is in use")
    return _NAME


def page_module(name: str) -> ModuleType:
    """Import a module of the page's package.

    Args:
        name: of the module in the package, such as ``server.serve``.

    Raises:
        SymgraspError: as `page_package`.
    """
    return import_module(f"{page_package()}.{name}")


def _is_ours() -> bool:
    """Tell whether importing the name of the page's package gives the one beside this package."""
    try:
        spec = find_spec(_NAME)
    except ValueError:  # loaded without saying from where
        return False
    return bool(spec and spec.origin and Path(spec.origin).resolve() == _FOLDER / _NAME / "__init__.py")
