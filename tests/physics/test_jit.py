"""Kernels compile, and a cache that cannot be used costs time only."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")

MODULE = """
from mdr_dask.physics.jit import jit, jit_inline

@jit_inline
def third(x):
    return x / 3

@jit
def doubled(x):
    return 6 * third(x)

print(doubled(21.0))
"""


def run(folder):
    (folder / "kernel.py").write_text(MODULE)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-c", "import kernel"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "content"), [("nbi", b""), ("nbc", b"\x80\x04torn")])
def test_a_torn_cache_file_is_compiled_again_with_a_warning(tmp_path, ending, content):
    assert run(tmp_path).stdout == "42.0\n"
    files = list(Path(tmp_path, "cache").rglob(f"*.{ending}"))
    assert files
    for path in files:
        path.write_bytes(content)
    again = run(tmp_path)
    assert (again.returncode, again.stdout) == (0, "42.0\n"), again.stderr
    assert "NUMBA_CACHE_DIR" in again.stderr


@pytest.mark.slow
def test_without_a_place_for_the_cache_kernels_run_with_a_warning():
    """Numba refuses to cache a function that has no file, as it does where no folder can be written."""
    ran = subprocess.run([sys.executable, "-c", MODULE], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (0, "42.0\n"), ran.stderr
    assert "NUMBA_CACHE_DIR" in ran.stderr
