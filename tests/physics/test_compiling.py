"""Compiled kernels that another version of the package left behind are not read."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba

MODULE = """
from mdr_dask.physics.compiling import compiled

@compiled
def doubled(x):
    return 2 * x

print(doubled(21))
"""


def test_an_index_of_another_version_is_no_error(tmp_path):
    (tmp_path / "kernel.py").write_text(MODULE)

    def run():
        command = [sys.executable, "-c", "import kernel"]
        beside = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        return subprocess.run(command, cwd=tmp_path, env=beside, capture_output=True, text=True, check=False)

    assert run().stdout == "42\n"
    (index,) = Path(tmp_path, "__pycache__").glob("*.nbi")
    gone = b"cmdr_dask.physics.gone\nProfile\n."
    index.write_bytes(pickle.dumps(numba.__version__) + gone)
    again = run()
    assert (again.returncode, again.stdout) == (0, "42\n"), again.stderr
