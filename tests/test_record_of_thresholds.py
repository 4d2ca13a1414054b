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
        f"{room.__name__}.{name}": numbers
        for room in rooms()
        for name, value in vars(room).items()
        if name.isupper() and (numbers := _numbers(value))
    }
    record.check(dataframe_regression, found)


def _numbers(value):
    """Numbers alone, in their order, of a number or of several; none of anything else."""
    several = value.values() if isinstance(value, dict) else value
    parts = [*several] if isinstance(value, tuple | list | range | dict) else [value]
    return parts if all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts) else []
