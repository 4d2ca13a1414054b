"""What a kernel compiles, and that what another version of the package left behind is not read."""

import gc
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core.event import Listener, install_listener

import mdr_dask
from mdr_dask.physics.compiling import compiled

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")

MODULE = """
from mdr_dask.physics.compiling import compiled

@compiled
def doubled(x):
    return 2 * x

print(doubled(21))
"""


def run(folder):
    command = [sys.executable, "-c", "import kernel"]
    beside = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    return subprocess.run(command, cwd=folder, env=beside, capture_output=True, text=True, check=False)


def test_an_index_of_another_version_is_no_error(tmp_path):
    (tmp_path / "kernel.py").write_text(MODULE)
    assert run(tmp_path).stdout == "42\n"
    (index,) = Path(tmp_path, "__pycache__").glob("*.nbi")
    gone = b"cmdr_dask.physics.gone\nProfile\n."
    index.write_bytes(pickle.dumps(numba.__version__) + gone)
    again = run(tmp_path)
    assert (again.returncode, again.stdout) == (0, "42\n"), again.stderr


CALLED = """
from mdr_dask.physics.compiling import compiled
from mdr_dask.physics.constant import FACTOR

@compiled
def scaled(x):
    return FACTOR * x
"""


@pytest.mark.parametrize(
    "imported", ["from mdr_dask.physics.called import scaled", "from mdr_dask.physics import called"]
)
def test_a_kernel_is_compiled_again_when_what_it_calls_has_changed(imported, tmp_path):
    """Its machine code holds that of its callees and the constants of other files, at which numba does not look."""
    physics = tmp_path / "mdr_dask" / "physics"
    physics.mkdir(parents=True)
    for package in (physics.parent, physics):
        (package / "__init__.py").touch()
    for name in ("arrays.py", "version.py", "physics/compiling.py"):
        shutil.copy(Path(mdr_dask.__file__).parent / name, tmp_path / "mdr_dask" / name)
    (physics / "called.py").write_text(CALLED)
    call = "scaled(x)" if "scaled" in imported else "called.scaled(x)"
    (tmp_path / "kernel.py").write_text(MODULE.replace("\n@", f"{imported}\n\n@").replace("2 * x", call))
    for factor, value in ((2, "42\n"), (3, "63\n")):
        (physics / "constant.py").write_text(f"FACTOR = {factor}\n")
        ran = run(tmp_path)
        assert (ran.returncode, ran.stdout) == (0, value), ran.stderr


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
