"""The notebook that walks through the paper runs from top to bottom and shows what it promises."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parent.parent.parent
NOTEBOOK = ROOT / "docs/paper.ipynb"


@pytest.fixture(scope="module")
def executed(tmp_path_factory) -> nbformat.NotebookNode:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    folder = tmp_path_factory.mktemp("notebook")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))
        client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(folder)}})
        with ThreadPoolExecutor(1) as thread:  # a browser test may have left an event loop in this one
            thread.submit(client.execute).result()
    assert not list(folder.iterdir())  # in a notebook nothing is written
    return notebook


def kinds(cell: nbformat.NotebookNode) -> list[str]:
    """What a cell shows besides text."""
    found = [kind for output in cell.outputs for kind in output.get("data", {})]
    return [kind for kind in found if kind != "text/plain"]


def cell_with(notebook: nbformat.NotebookNode, text: str) -> nbformat.NotebookNode:
    return next(cell for cell in notebook.cells if cell.cell_type == "code" and text in cell.source)


def test_it_runs_and_warns_of_nothing(executed):
    outputs = [output for cell in executed.cells for output in cell.get("outputs", [])]
    assert outputs
    assert not [output for output in outputs if output.get("name") == "stderr"]


def test_maps_and_plans_show_pictures_and_the_3d_view(executed):
    assert kinds(cell_with(executed, "pour.show()")) == ["image/png", "text/html"]
    assert kinds(cell_with(executed, "best.show()")) == ["image/png"] * 3 + ["text/html"]
    assert kinds(cell_with(executed, "complete.show()")) == ["image/png"] * 2 + ["text/html"]
    assert kinds(cell_with(executed, "shifted")) == ["image/png"]
    (frame,) = (o.data["text/html"] for o in cell_with(executed, "pour.show()").outputs if "data" in o
                and "text/html" in o.data)  # fmt: skip
    assert "__VISER_EMBED_DATA__" in frame


def test_it_is_kept_without_outputs():
    for cell in nbformat.read(NOTEBOOK, as_version=4).cells:
        if cell.cell_type == "code":
            assert not cell.outputs
            assert cell.execution_count is None
    assert "/home/" not in NOTEBOOK.read_text()
