"""On record: the numbers by which everything but the physics decides what is enough, near, far or too much."""

import importlib
import pkgutil

import record

import mdr_dask


def rooms():
    """Every module of the package beside those of physics, whose numbers closed forms and references judge."""
    for each in pkgutil.walk_packages(mdr_dask.__path__, "mdr_dask."):
        if not each.name.startswith("mdr_dask.physics") and not each.name.endswith("__main__"):
            yield importlib.import_module(each.name)


def test_thresholds_are_on_record(dataframe_regression):
    found = {
        f"{room.__name__}.{name}": value
        for room in rooms()
        for name, value in vars(room).items()
        if name.isupper() and _is_number(value)
    }
    record.check(dataframe_regression, found)


def _is_number(value):
    parts = value if isinstance(value, tuple) else (value,)
    return all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts)
