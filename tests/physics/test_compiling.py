"""What a kernel compiles, and that what another version of the package left behind is not read."""

import gc
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core.event import Listener, install_listener

from mdr_dask.physics.compiling import compiled

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")

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


def test_a_number_written_in_a_call_compiles_no_kernel_of_its_own():
    @compiled
    def raised(x, power):
        return x**power

    @compiled
    def summed(x):
        total, power = raised(x, 2), 0
        while power < 3:
            total += raised(x, power)
            power += 1
        return total

    assert summed(2.0) == 4 + 1 + 2 + 4
    assert list(raised.overloads) == [(numba.float64, numba.int64)]


def test_garbage_is_collected_after_compiling_but_not_meanwhile():
    collects = []

    class Noting(Listener):
        def on_start(self, event):
            collects.append(gc.isenabled())

        def on_end(self, event):
            pass

    @compiled
    def halved(x):
        return x / 2

    halved._cache.disable()  # type: ignore[attr-defined]
    with install_listener("numba:run_pass", Noting()):
        assert halved(3.0) == 1.5
    assert not any(collects)
    assert collects
    assert gc.isenabled()
