"""Finding the page's package, which this package runs but does not import otherwise.

In a checkout it is the folder ``app`` beside this package; a wheel holds it as ``symgrasp_app``.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

__all__ = ["import_page"]

_FOLDER = Path(__file__).resolve().parent.parent
_NAME = "symgrasp_app" if (_FOLDER / "symgrasp_app").is_dir() else "app"


def import_page(module: str) -> ModuleType:
    """Import a module of the page that belongs to this package, whatever else is named ``app``.

    Args:
        module: its name inside the page's package, such as ``server.serve``.

    Raises:
        ImportError: the page is not there, or another package of its name is imported already.
    """
    if not _is_ours():
        # On the path, because the processes that the page starts get this path and import it again.
        sys.path.insert(0, str(_FOLDER))
        if not _is_ours():
            raise ImportError(f"no page of symgrasp in {_FOLDER / _NAME}, or another {_NAME!r} is in use")
    return import_module(f"{_NAME}.{module}")


def _is_ours() -> bool:
    """Tell whether importing the name of the page's package gives the one beside this package."""
    try:
        spec = find_spec(_NAME)
    except ValueError:  # loaded without saying from where
        return False
    return bool(spec and spec.origin and Path(spec.origin).resolve() == _FOLDER / _NAME / "__init__.py")
