import hashlib
import importlib
import os
import pkgutil
from pathlib import Path

import hypothesis
import pytest
import threadpoolctl
import toy as toy_model

import mdr_dask

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
    """What waits or takes long begins first: other workers have the cores meanwhile, and none is idle in the end."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_collection_finish(session):
    """Constants of modules are among the examples: of all modules, whatever the tests before have imported."""
    if any(getattr(getattr(item, "obj", None), "is_hypothesis_test", False) for item in session.items):
        for each in pkgutil.walk_packages(mdr_dask.__path__, "mdr_dask."):
            if not each.name.endswith("__main__"):
                importlib.import_module(each.name)


@pytest.fixture(autouse=True, scope="session")
def disk_is_not_waited_for():
    """Stores of tests need not outlive a loss of power; that blocks are flushed has a test of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("mdr_dask.store.files.flush", lambda path: None)
        yield


@pytest.fixture(autouse=True, scope="session")
def one_thread_of_linear_algebra():
    """The workers of pytest have the cores; more threads would wait for each other, and count as work."""
    with threadpoolctl.threadpool_limits(1, "blas"):
        yield


@pytest.fixture
def toy(monkeypatch):
    """The toy model, known to the runner for the length of a test."""
    toy_model.register(monkeypatch)
    toy_model.COMPUTED.clear()
    return toy_model


@pytest.fixture
def url(tmp_path):
    return str(tmp_path / "study.zarr")
