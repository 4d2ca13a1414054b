"""What a kernel compiles, and that what another version of the package left behind is not read."""

import gc
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.event import Listener, install_listener

import mdr_dask
from mdr_dask.physics.compiling import compiled, greater, last_until, lesser, nested, spliced

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


@nested
def third(x):
    return x / 3


@spliced
def doubled(x):
    if x < 0:
        return -2 * x
    return 2 * x


@compiled
def combined(x):
    total = 0
    for _ in range(3):
        total = total + third(x) + doubled(x) + greater(x, -x) - lesser(x, -x)
    return total


@spliced
def once(x):
    return 3 * x


@compiled
def within(x):
    return once(x)


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


def test_a_kernel_is_what_its_functions_are_in_python():
    """Its variables are of one type from the first to the last value, as numba's are not."""
    for x in (2.0, -0.7, 0.0):
        assert combined(x) == combined.py_func(x)


def test_what_only_kernels_call_has_neither_a_file_nor_what_python_calls():
    combined(1.0)
    third.in_kernels.compile((numba.float64,))  # there already, unless `combined` came from its file
    (signature,) = third.in_kernels.overloads
    assert "cpython" not in third.in_kernels.inspect_llvm(signature)
    assert third.in_kernels.stats.cache_path is None
    assert within(1.0) == 3.0
    assert not once.overloads, "a spliced function is compiled within its caller only"
    assert (third(1.5), doubled(-2.0)) == (0.5, 4.0)
    assert np.isinf(third(np.inf)), "and from Python it divides as in kernels"


def test_kernels_skip_the_passes_that_they_have_no_use_for():
    """By the names that numba gives them: were one of them called otherwise, compiling would take longer again."""
    taken = []

    class Noting(Listener):
        def on_start(self, event):
            taken.append(event.data["name"].split()[0])

        def on_end(self, event):
            pass

    @compiled
    def quarter(x):
        return x / 4

    quarter._cache.disable()  # type: ignore[attr-defined]
    with install_listener("numba:run_pass", Noting()):
        assert quarter(3.0) == 0.75
    skipped = {"reconstruct_ssa", "strip_phis", "inline_closure_likes", "nopython_rewrites"}
    assert "nopython_type_inference" in taken
    assert not skipped & set(taken)
    every = {"ReconstructSSA", "PreLowerStripPhis", "InlineClosureLikes", "NopythonRewrites"}
    assert every <= set(vars(numba.core.typed_passes)) | set(vars(numba.core.untyped_passes))


@pytest.mark.parametrize("one", [0.0, -0.0, 1.5, np.inf, np.nan])
@pytest.mark.parametrize("other", [0.0, -0.0, -2.0, np.nan])
def test_the_greater_and_the_lesser_are_those_of_python(one, other):
    pairs = ((greater(one, other), max(one, other)), (lesser(one, other), min(one, other)))
    for found, expected in pairs:
        assert np.float64(found).tobytes() == np.float64(expected).tobytes()


def test_the_last_value_until_a_place_is_that_of_a_search():
    values = np.array([0.0, 0.5, 0.5, 2.0])
    for x in (-1.0, 0.0, 0.3, 0.5, 1.9, 2.0, 5.0):
        expected = max(int(np.searchsorted(values, x, side="right")) - 1, 0)
        assert last_until(values, x, 0, values.size) == expected
        assert last_until(values, x, 0, 3) == min(expected, 2)
