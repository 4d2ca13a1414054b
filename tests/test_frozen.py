"""Data that is handed on cannot be changed, and is compared as it was declared."""

import dataclasses
import importlib
import inspect
import pkgutil

import pytest

#: Classes that gather while they live.
CHANGING = {"Document", "_Group", "Inspection", "Group"}
#: Classes that hold arrays, which have no truth value: one is equal to itself alone.
BY_IDENTITY = {
    *("Panels", "TableProfile", "UniformGrid", "Spectrum", "Moment", "Pressed", "ForcedSlip", "_State"),
    *("PartialSlip", "GrossSlip", "Worn"),
}
ROOMS = ("physics", "models", "fits", "plots", "campaign", "store", "questions", "report", "execute", "cli")


@pytest.mark.parametrize("room", ROOMS)
def test_data_is_frozen_and_compared_as_declared(room):
    found = {}
    for module in pkgutil.walk_packages(importlib.import_module(f"mdr_dask.{room}").__path__, f"mdr_dask.{room}."):
        for name, kind in vars(importlib.import_module(module.name)).items():
            if inspect.isclass(kind) and kind.__module__ == module.name and dataclasses.is_dataclass(kind):
                found[name] = kind.__dataclass_params__
    assert found
    assert {name for name, told in found.items() if not told.frozen} <= CHANGING
    assert {name for name, told in found.items() if not told.eq} == BY_IDENTITY & found.keys()
