"""On record: the numbers by which models, fits, questions, figures and adaptive axes decide what is enough or far."""

import importlib
import pkgutil

import record

from mdr_dask import aggregation, fits, models, plots, questions, refinement, tables, units
from mdr_dask.store import reading


def modules_of(package):
    for each in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        yield importlib.import_module(each.name)


def test_thresholds_are_on_record(dataframe_regression):
    rooms = [
        aggregation,
        reading,
        refinement,
        tables,
        units,
        *(each for room in (fits, questions, plots, models) for each in modules_of(room)),
    ]
    found = {
        f"{room.__name__}.{name}": value
        for room in rooms
        for name, value in vars(room).items()
        if name.isupper() and _is_number(value)
    }
    record.check(dataframe_regression, found)


def _is_number(value):
    parts = value if isinstance(value, tuple) else (value,)
    return all(isinstance(part, int | float) and not isinstance(part, bool) for part in parts)
