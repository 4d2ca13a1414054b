"""Data that is handed on cannot be changed, and is compared as it was declared."""

import dataclasses
import importlib
import inspect
import pkgutil

import pytest

import mdr_dask

#: Classes that gather while they live.
CHANGING = {"Document", "_Group", "Inspection", "Group"}
#: Classes that hold arrays, which have no truth value: one is equal to itself alone.
BY_IDENTITY = {
    *("Panels", "TableProfile", "UniformGrid", "Spectrum", "Moment", "Pressed", "ForcedSlip", "_State"),
    *("PartialSlip", "GrossSlip", "Worn"),
}
ROOMS = ("physics", "models", "fits", "plots", "campaign", "store", "questions", "report", "execute", "cli")
#: Rooms of one module each.
SINGLE = [f"mdr_dask.{each.name}" for each in pkgutil.iter_modules(mdr_dask.__path__) if not each.ispkg]


def modules_of(room):
    package = importlib.import_module(f"mdr_dask.{room}")
    return [module.name for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")]


@pytest.mark.parametrize("modules", [SINGLE, *map(modules_of, ROOMS)], ids=["single", *ROOMS])
def test_data_is_frozen_and_compared_as_declared(modules):
    found = {}
    for module in modules:
        for name, kind in vars(importlib.import_module(module)).items():
            if inspect.isclass(kind) and kind.__module__ == module and dataclasses.is_dataclass(kind):
                found[name] = kind.__dataclass_params__
    assert found
    assert {name for name, told in found.items() if not told.frozen} <= CHANGING
    assert {name for name, told in found.items() if not told.eq} == BY_IDENTITY & found.keys()
