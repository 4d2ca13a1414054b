"""A campaign of the toy model with slow blocks, for tests that interrupt processes."""

import os
import subprocess
import sys
from pathlib import Path

#: The toy model with a pause in every block.
MODEL = """
import os, time
from dataclasses import replace
import toy

def compute(block):
    time.sleep(float(os.environ.get("PAUSE", "0")))
    return toy.compute(block)

MODEL = replace(toy.MODEL, name="slow_toy", compute=compute)
"""
CAMPAIGN = """
name: long
model: slow_toy:MODEL
seed: 1
realisations: {blocks}
parameters: {{position: [1 m, 2 m]}}
store: {{path: long.zarr, blocks: {{position: 1, realisation: 1}}}}
"""


def make(folder: Path, blocks: int, pause: float) -> dict[str, str]:
    """Write the campaign and its model; return the environment variables that make them available."""
    (folder / "slow_toy.py").write_text(MODEL)
    (folder / "long.yaml").write_text(CAMPAIGN.format(blocks=blocks))
    tools = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    return {"PYTHONPATH": f"{folder}:{Path(__file__).parent}", "PATH": tools, "PAUSE": str(pause)}


def mdr_dask(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["mdr-dask", *arguments], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
