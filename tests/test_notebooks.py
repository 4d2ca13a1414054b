"""Every notebook runs."""

import ast
import json
from pathlib import Path

import matplotlib as mpl
import pytest

FOLDER = Path(__file__).parent.parent / "docs/notebooks"


def last_value(source: str, names: dict) -> object:
    """Run a cell; return the value of its last line, which a notebook would show."""
    *body, last = ast.parse(source).body
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    if isinstance(last, ast.Expr):
        return eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    exec(compile(ast.Module([last], []), "cell", "exec"), names)
    return None


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_every_cell_runs(path, monkeypatch):
    monkeypatch.chdir(FOLDER)
    mpl.use("Agg")
    notebook, names = json.loads(path.read_text()), {}
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    shown = [last_value(source, names) for source in cells]
    assert len(cells) >= 3
    assert shown[-1] is not None
    assert shown[-1] is not False
    assert (names["study"].status == 1).all()
    assert not any(cell.get("outputs") for cell in notebook["cells"])
