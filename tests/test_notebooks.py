import ast
import os
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted(Path(__file__).parents[1].joinpath("notebooks").glob("*.ipynb"))


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_defines_nothing_and_is_committed_executed(path):
    cells = code_cells(nbformat.read(path, as_version=4))
    for cell in cells:
        if cell.source.startswith("%%writefile"):
            continue  # a module of the reader's own
        plain = "\n".join(line for line in cell.source.splitlines() if not line.startswith("%"))
        nodes = list(ast.walk(ast.parse(plain)))
        assert not [node for node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Lambda)]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert not [output for cell in cells for output in cell.outputs if output.output_type == "error"]
    assert path.stat().st_size < 500_000


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_from_an_empty_folder(path, tmp_path):
    if path.stem in os.environ.get("SYMSHREC_SKIP_NOTEBOOKS", "").split():
        pytest.skip("left out by SYMSHREC_SKIP_NOTEBOOKS")
    notebook = nbformat.read(path, as_version=4)
    for cell in code_cells(notebook):
        cell.outputs, cell.execution_count = [], None
    folder = tmp_path / "notebooks"
    folder.mkdir()
    where, quiet = {"metadata": {"path": str(folder)}}, ["--log-level=ERROR"]
    NotebookClient(notebook, timeout=300, resources=where, extra_arguments=quiet).execute()
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    assert [output for output in outputs if "image/png" in output.get("data", {})]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]


def test_there_are_notebooks():
    assert NOTEBOOKS
