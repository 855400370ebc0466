"""The notebooks of docs/examples: they run as they are, and what is committed is what they show."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from conftest import ROOT
from nbclient import NotebookClient

NOTEBOOKS = sorted((ROOT / "docs/examples").glob("*.ipynb"))
#: A notebook with three pictures has 220 kB.
LARGEST = 300_000


def shown(cell: nbformat.NotebookNode) -> list[str]:
    """Kinds of a cell's outputs, text put together."""
    kinds = [
        output.get("name") or next(iter(sorted(output.get("data", {}))), output.output_type)
        for output in cell.get("outputs", [])
    ]
    return [kind for place, kind in enumerate(kinds) if kinds[place - 1 : place] != [kind]]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_show_what_is_committed(path):
    """Catches a name that is no more, an output that is missing, and a notebook that was committed unrun."""
    committed = nbformat.read(path, as_version=4)
    run = nbformat.read(path, as_version=4)
    for cell in run.cells:
        if cell.cell_type == "code":
            cell.outputs = []
    resources = {"metadata": {"path": str(path.parent)}}
    NotebookClient(run, timeout=120, kernel_name="python3", resources=resources).execute()
    for before, after in zip(committed.cells, run.cells, strict=True):
        if before.cell_type == "code":
            assert before.execution_count == after.execution_count
            assert shown(before) == shown(after), before.source


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_small_and_tell_nothing_of_a_machine(path):
    """Catches outputs that swell the repository, errors that are committed, and paths of who ran them."""
    text = path.read_text(encoding="utf-8")
    assert len(text) < LARGEST
    notebook = nbformat.reads(text, as_version=4)
    nbformat.validate(notebook)
    told = [
        str(output.get("text", "")) + str({k: v for k, v in output.get("data", {}).items() if "png" not in k})
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
    ]
    assert not [
        entry for entry in told if re.search(r"/(home|root|tmp|work|usr|Users)/|site-packages", entry)
    ]
    assert all(
        output.output_type != "error" and output.get("name") != "stderr"
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
    )
    assert str(Path.home()) not in text


def test_there_are_notebooks():
    """Catches a folder that was moved: the tests above would then test nothing."""
    assert {path.stem for path in NOTEBOOKS} >= {"first-solve", "relight", "scalability"}
