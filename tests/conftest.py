"""Settings and fixtures of all tests."""

import hashlib
import importlib
import os
import pkgutil
import shutil
import signal
from pathlib import Path

import hypothesis
import pytest
import threadpoolctl
import toy as toy_model
from small_campaign import CAMPAIGN

import mdr_dask
from mdr_dask.cli import main

TESTS = Path(__file__).parent
PHYSICS = Path(mdr_dask.__file__).parent / "physics"
if "NUMBA_CACHE_DIR" not in os.environ:
    # numba compares a kernel's own file only: a changed function that kernels of other files call needs a new cache
    sources = b"".join(path.read_bytes() for path in sorted(PHYSICS.rglob("*.py")))
    name = hashlib.sha1(sources, usedforsecurity=False).hexdigest()[:12]
    os.environ["NUMBA_CACHE_DIR"] = str(PHYSICS.parents[1] / ".numba_cache" / name)

os.environ.pop("COLUMNS", None)  # xdist exports it, and messages are wrapped where it is exported

# the same examples every time; `--hypothesis-profile=search` looks for new ones; no deadline, for machines may be busy
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.register_profile("search", deadline=None)
hypothesis.settings.load_profile("repeatable")


def pytest_collection_modifyitems(items):
    """Run slow tests first, so that no worker is idle in the end, and then the tests of solvers.

    pytest-xdist gives the first half of the tests to the first of two workers. It compiles most kernels, and the other
    worker finds them in the cache. Kernels that take longest to compile, and that the other half needs, come first.
    """
    first = ("physics/superposition", "physics/sliding", "physics/transients", "physics", "models", "fits")
    rooms = {TESTS / room: rank for rank, room in enumerate(first)}

    def order(item):
        rank = min((rooms[parent] for parent in item.path.parents if parent in rooms), default=len(rooms))
        return item.get_closest_marker("slow") is None, rank

    items.sort(key=order)


def pytest_collection_finish(session):
    """Import all modules: hypothesis draws constants from imported modules, whatever tests ran before."""
    if any(getattr(getattr(item, "obj", None), "is_hypothesis_test", False) for item in session.items):
        for each in pkgutil.walk_packages(mdr_dask.__path__, "mdr_dask."):
            if not each.name.endswith("__main__"):
                importlib.import_module(each.name)


@pytest.fixture(autouse=True, scope="session")
def disk_is_not_waited_for():
    """Do not flush files to the disk: stores of tests need not survive a loss of power."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mdr_dask.store.files.flush", lambda path: None)
        yield


@pytest.fixture(autouse=True, scope="session")
def one_thread_of_linear_algebra():
    """Use one thread of linear algebra, because the workers of pytest use all cores."""
    with threadpoolctl.threadpool_limits(1, "blas"):
        yield


@pytest.fixture
def toy(monkeypatch):
    """Register the toy model for one test."""
    toy_model.register(monkeypatch)
    toy_model.COMPUTED.clear()
    return toy_model


@pytest.fixture
def url(tmp_path):
    return str(tmp_path / "study.zarr")


@pytest.fixture
def campaign(tmp_path, monkeypatch) -> Path:
    """The file of the small campaign, in the working directory."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "small.yaml"
    path.write_text(CAMPAIGN)
    return path


@pytest.fixture(scope="session")
def finished(tmp_path_factory) -> Path:
    """The store of the small campaign."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "small.yaml").write_text(CAMPAIGN)
    assert main(["run", str(folder / "small.yaml"), "--quiet", "--store", str(folder / "small.zarr")]) == 0
    return folder / "small.zarr"


@pytest.fixture
def filled(campaign, finished) -> str:
    """A copy of the store of the small campaign."""
    shutil.copytree(finished, "results/small.zarr")
    return "results/small.zarr"


@pytest.fixture
def heeds_interrupts():
    """This process and those that a test starts react to Ctrl-C, even in the background of a shell or of pytest."""
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, handler)
