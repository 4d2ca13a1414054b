"""Pages of the documentation: guide and examples run, campaigns are valid, links exist."""

import math
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from mdr_dask import campaign
from mdr_dask.cli import main

ROOT = Path(__file__).parent.parent
PAGES = sorted([*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
RUN = {"guide": "rubber.png", "examples": "dma-master-curve.png"}
CAMPAIGN = re.compile(r"^```(?:yaml|sh)\n(?:cat [^\n]*\n)?(name: .*?)^(?:YAML|```)", flags=re.M | re.S)
SHOWN = [
    pytest.param(text, id=f"{page.stem}-{text.split()[1]}")
    for page in PAGES
    if page.stem not in ("own-model", "campaign-file")
    for text in CAMPAIGN.findall(page.read_text())
]


#: A command that needs no shell: it is run within the test, for starting a process takes longer than most of them.
PLAIN = re.compile(r"^mdr-dask ([^|<>;&`$\n]*)\n", flags=re.M)


def run_shell(text):
    """Run a block of shell: bash has what stands between plain commands."""
    between, *rest = PLAIN.split(text)
    for command, after in zip(["", *rest[::2]], [between, *rest[1::2]], strict=True):
        assert not command or main(shlex.split(command, comments=True)) == 0, command
        if after.strip():
            done = subprocess.run(["bash", "-euc", after], capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{after}\n{done.stdout}\n{done.stderr}"


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_a_page_runs_as_it_stands(page, tmp_path, monkeypatch):
    (tmp_path / "campaigns").symlink_to(ROOT / "campaigns")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```(sh|python)\n(.*?)^```", (ROOT / f"docs/{page}.md").read_text(), flags=re.M | re.S)
    assert len(blocks) > 3
    for language, text in blocks:
        if language == "sh":
            run_shell(text)
        else:
            exec(text, {})
    assert (tmp_path / RUN[page]).stat().st_size > 10_000


def test_campaigns_are_found_in_the_pages():
    assert len(SHOWN) >= 12


@pytest.mark.parametrize("text", SHOWN)
def test_every_campaign_shown_is_right(text, tmp_path):
    moduli = [
        (frequency, 1 + (2j * math.pi * frequency * 10 ** (-0.1 * (celsius - 25))) ** 0.3, celsius)
        for celsius in (15, 25, 35)
        for frequency in (0.1, 0.3, 1, 3, 10, 30)
    ]
    rows = "\n".join(f"{f},{m.real:.6g},{m.imag:.6g},{celsius}" for f, m, celsius in moduli)
    (tmp_path / "dma.csv").write_text(f"f [Hz],E' [MPa],E'' [MPa],T [degC]\n{rows}\n")
    wavenumbers = (1e3, 1e4, 1e5, 1e6, 1e7)
    rows = "\n".join(f"{q:g},{1e-2 * q**-3.6:g}" for q in wavenumbers)
    (tmp_path / "road.csv").write_text(f"wavenumber [rad/m],C2D [m^4]\n{rows}\n")
    assert campaign.loads(text, "page.yaml", str(tmp_path)).series


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_link_is_dead(page):
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text()):
        assert target.startswith("http") or (page.parent / target).exists(), target
