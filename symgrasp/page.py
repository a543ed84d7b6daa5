"""The package of the page, which nothing here may import until it is asked for, and showing what it draws."""

from __future__ import annotations

import json
import secrets
import sys
import tempfile
import webbrowser
from html import escape
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from symgrasp.errors import SymgraspError

__all__ = ["LivePage", "in_notebook", "page_module", "page_package", "show_html", "show_picture"]

_FOLDER = Path(__file__).resolve().parent.parent
_NAME = "symgrasp_app" if (_FOLDER / "symgrasp_app").is_dir() else "app"

FRAME_HEIGHT = 480
"""Height (px) of a 3D view in a notebook."""


LIVE_HEIGHT = 700
"""Height (px) of the live page in a notebook."""

# The document stays where nobody answers: on another machine, later on, or where scripts do not run.
LIVE = """<script>(() => {{
  const frame = document.getElementById({name}).querySelector("iframe"), probe = new Image();
  probe.onload = () => {{
    frame.removeAttribute("srcdoc");
    frame.height = {height};
    frame.src = {address};
  }};
  probe.src = {probe};
}})()</script>"""


class LivePage(NamedTuple):
    """A page that a server shows.

    Attributes:
        address: of the page.
        probe: address of a picture that can be loaded from everywhere as long as the server runs.
    """

    address: str
    probe: str


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


def in_notebook() -> bool:
    """Whether this is a Jupyter kernel, which can display pictures and pages."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return getattr(shell, "kernel", None) is not None


def show_picture(png: bytes, name: str) -> None:
    """Display a picture in a notebook; elsewhere write it to a file and print where.

    Args:
        png: the picture.
        name: what it shows, for the file.
    """
    if in_notebook():
        from IPython.display import Image, display

        display(Image(png))
    else:
        print(f"{name}: {_written(png, name, '.png').as_uri()}")


def show_html(document: str, name: str, live: LivePage | None = None) -> None:
    """Display an HTML document in a notebook; elsewhere write it to a file, print where, and open it.

    Args:
        document: the document; it needs no other file.
        name: what it shows, for the file.
        live: takes the place of the document in a notebook while its server can be reached.
    """
    if in_notebook():
        from IPython.display import HTML, display

        frame = f'<iframe srcdoc="{escape(document)}" width="100%" height="{FRAME_HEIGHT}"></iframe>'
        place, script = secrets.token_hex(8), ""
        if live:
            texts = (json.dumps(text) for text in (place, *live))
            texts = dict(zip(("name", "address", "probe"), texts, strict=True))
            script = LIVE.format(height=LIVE_HEIGHT, **texts)
        display(HTML(f'<div id="{place}">{frame}</div>{script}'))
    else:
        address = _written(document.encode(), name, ".html").as_uri()
        print(f"{name} in 3D: {address}")
        webbrowser.open(address)


def _written(content: bytes, name: str, ending: str) -> Path:
    """Write a file that outlives this program, and return its path."""
    stem = "".join(c if c.isalnum() else "_" for c in name)
    with tempfile.NamedTemporaryFile(prefix=f"{stem}_", suffix=ending, delete=False) as file:
        file.write(content)
    return Path(file.name)
