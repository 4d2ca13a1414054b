"""Formatting, types, import contracts, light start-up and current reference pages."""

import json
import re
import subprocess
import sys
from pathlib import Path

import click
import pytest

from mdr_dask import campaign, fits, models, plots
from mdr_dask.campaign.reference import reference_page
from mdr_dask.cli import cli, main
from mdr_dask.cli.reference import commands_page

ROOT = Path(__file__).parent.parent
BESIDE_PYTHON = Path(sys.executable).parent


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "command",
    ["ruff format --check .", "ruff check .", "mypy", "lint-imports"],
    ids=["format", "lint", "types", "imports"],
)
def test_tools_report_nothing(command):
    name, *arguments = command.split()
    done = run(str(BESIDE_PYTHON / name), *arguments)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("statement", "forbidden"),
    [
        ("import mdr_dask", {"dask", "distributed", "numba", "matplotlib", "scipy", "zarr", "xarray"}),
        ("import mdr_dask.cli", {"dask", "numba", "matplotlib", "pydantic", "pint", "numpy", "xarray", "rich"}),
        ("import mdr_dask.campaign", {"dask", "distributed", "numba", "matplotlib", "pint", "scipy", "xarray"}),
        (
            "from mdr_dask import fits, plots, report; fits.available('my:MODEL'); plots.available('my:MODEL')",
            {"numba", "scipy.stats", "matplotlib.figure"},
        ),
        (
            "from mdr_dask.cli import main; main(['models', 'sliding_friction'])",
            {"dask", "matplotlib", "numba", "pandas", "scipy", "xarray", "zarr"},
        ),
    ],
)
def test_importing_loads_only_what_is_used(statement, forbidden):
    done = run(sys.executable, "-c", f"import sys; {statement}; print(' '.join(sys.modules))")
    assert done.returncode == 0, done.stderr
    assert not forbidden & set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("name", sorted(cli.commands))
def test_every_command_has_help_an_example_and_a_place_in_the_docs(name):
    command = cli.commands[name]
    assert f"mdr-dask {name}" in (command.help or "")
    assert all(option.help for option in command.params if isinstance(option, click.Option))
    assert f"## mdr-dask {name}" in (ROOT / "docs/commands.md").read_text()


def test_help_lists_the_commands_in_groups(capsys):
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert printed.index("\nstudy:") < printed.index("\nanswers:") < printed.index("\nmore:")
    assert all(name in printed for name in cli.commands)


def test_reference_pages_are_current():
    assert (ROOT / "docs/commands.md").read_text() == commands_page()
    assert (ROOT / "docs/campaign-file.md").read_text() == reference_page()
    assert json.loads((ROOT / "docs/campaign.schema.json").read_text()) == campaign.json_schema()


@pytest.mark.parametrize("path", sorted((ROOT / "campaigns").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_campaign_is_valid(path):
    study = campaign.load(path)
    assert study.name == path.stem
    assert study.remarks == ()  # no bare number is questioned


def test_every_fit_and_figure_is_registered_for_a_model():
    for room, folder in ((fits, "fits"), (plots, "plots")):
        written = {path.stem for path in (ROOT / "mdr_dask" / folder).glob("*.py")} - {"__init__", "base"}
        named = {name for name in written if not name.startswith("_")}
        assert set(room.SUBJECTS) <= named
        assert any(room.available(model) for model in models.NAMES)


def test_the_first_two_shell_blocks_of_the_readme_are_one_command_line_each():
    blocks = re.findall(r"^```sh\n(.*?)^```", (ROOT / "README.md").read_text(), flags=re.M | re.S)
    assert all(len(block.strip().splitlines()) == 1 for block in blocks[:2])
    assert "quickstart" in blocks[0]
    assert "pytest" in blocks[1]
