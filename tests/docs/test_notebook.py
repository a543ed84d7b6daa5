"""The notebooks run from top to bottom and show what they promise."""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from symgrasp.object.library import library_objects

ROOT = Path(__file__).parent.parent.parent
NOTEBOOK = ROOT / "docs/paper.ipynb"
NOTEBOOKS = sorted((ROOT / "docs").glob("*.ipynb"))


@pytest.fixture(scope="module")
def executed(tmp_path_factory) -> nbformat.NotebookNode:
    return execute(NOTEBOOK, tmp_path_factory.mktemp("notebook"))


def execute(path: Path, folder: Path) -> nbformat.NotebookNode:
    """Run a notebook in a folder."""
    notebook = nbformat.read(path, as_version=4)
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


def printed(notebook: nbformat.NotebookNode, stream: str = "stdout") -> str:
    """What its cells print."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return "".join(output.text for output in outputs if output.get("name") == stream)


def test_it_runs_and_warns_of_nothing(executed):
    assert printed(executed)
    assert not printed(executed, "stderr")


def test_maps_and_plans_show_pictures_and_the_3d_view(executed):
    assert kinds(cell_with(executed, "pour.show()")) == ["image/png", "text/html"]
    assert kinds(cell_with(executed, "best.show()")) == ["image/png"] * 3 + ["text/html"]
    assert kinds(cell_with(executed, "complete.show()")) == ["image/png"] * 2 + ["text/html"]
    assert kinds(cell_with(executed, "shifted")) == ["image/png"]
    (frame,) = (o.data["text/html"] for o in cell_with(executed, "pour.show()").outputs if "data" in o
                and "text/html" in o.data)  # fmt: skip
    assert "__VISER_EMBED_DATA__" in frame


@pytest.mark.thorough
def test_the_atlas_shows_every_object_of_the_library(tmp_path):
    done = execute(ROOT / "docs/atlas.ipynb", tmp_path)
    assert not printed(done, "stderr")
    for name in library_objects():
        assert re.search(rf"^{name} +\d+ % of the grasps, held at +\d+ % of the places$", printed(done), re.M)
    assert kinds(cell_with(done, '"share")')) == ["image/png"]
    assert kinds(cell_with(done, "feasible angles")) == ["image/png"]


@pytest.mark.thorough
def test_one_of_two_grippers_is_chosen(tmp_path):
    done = execute(ROOT / "docs/grippers.ipynb", tmp_path)
    assert not printed(done, "stderr")
    means = {
        hand: float(mean)
        for hand, mean in re.findall(r"^(\w+): +([\d.]+) % in the mean", printed(done), re.M)
    }
    assert len(means) == 2
    assert printed(done).rstrip().endswith(f"catalogue: {max(means, key=lambda hand: means[hand])}")
    assert kinds(cell_with(done, '"share")')) == ["image/png"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_is_kept_without_outputs(path):
    for cell in nbformat.read(path, as_version=4).cells:
        if cell.cell_type == "code":
            assert not cell.outputs
            assert cell.execution_count is None
    assert "/home/" not in path.read_text()
