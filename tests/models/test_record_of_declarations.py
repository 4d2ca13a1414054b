"""What every model declares on record: parameters with bounds, defaults and units, outputs, numbers, flags."""

import dataclasses
import json
from typing import ClassVar

import numpy as np
import pytest
import record
from flattened import flat
from pydantic import BaseModel

from mdr_dask.models import base, load
from mdr_dask.models.base import Block, Result, Status
from mdr_dask.models.data_file import LARGEST_TABLE, DataFile
from mdr_dask.models.numbers import numbers_of
from mdr_dask.models.per_case import per_case

SAID = ("description", "title", "examples")


def declared(model):
    """One row for each parameter, output and number of a model, in words, and one for what else it says."""
    schema = model.parameters.model_json_schema()
    found = {}
    for part, definition in {"": schema, **schema.get("$defs", {})}.items():
        for name, field in definition.get("properties", {}).items():
            kept = {key: value for key, value in field.items() if key not in SAID}
            found[f"{part} {name}"] = json.dumps(kept, sort_keys=True)
    for output in (*model.outputs, *model.companions.values()):
        found[f"output {output.name}"] = [
            str(value) for value in dataclasses.astuple(output)[1:] if value != output.long_name
        ]
    for number in model.numbers:
        found[f"number {number.name}"] = number.formula
    parameters = model.parameters
    found["settings"] = sorted(parameters.settings)
    found["ways"] = [base.said(way) for way in parameters.alternatives]
    found["replaced"] = [*map(str, {**parameters.overrides, **parameters.requires, **parameters.renamed}.items())]
    return found | {"whole": model.whole, "compiling": model.compiling}


@pytest.mark.parametrize("name", ["ehl_line", "fretting_wear", "mixed_lubrication"])
def test_a_model_declares(name, dataframe_regression):
    record.check(dataframe_regression, flat("", declared(load(name))))


class Inner(base.Parameters):
    depth: float = base.quantity("m", "how deep", usual="2 mm", gt=0, default=0.002)
    count: int = base.quantity("1", "how many", default=3)


class Outer(base.Parameters):
    overrides: ClassVar = {"force": "width"}
    width: float = base.quantity("m", "how wide", default=0.5)
    force: float | None = base.quantity("N", "how strong", default=None)
    flag: bool = False
    places: tuple[float, ...] = base.quantity("m", "where", default=(0.1, 0.2))
    inner: Inner = Inner()

    def notes(self):
        return (f"wide {self.width}",)


def test_what_models_share(dataframe_regression):
    """Numbers of a parameter set, columns and parts of a block, cases solved one by one, what is refused."""
    columns = {"inner.depth": np.array([0.001, 0.004, -1.0]), "width": np.array([0.3, 0.2, 0.1])}
    block = Block(Outer(), columns, 3, (0, 5), 11, ("sum", "wave"))

    def solve(parameters, generator):
        if parameters.inner.depth < 0:
            raise ValueError("too shallow")
        chance = generator.random()
        return {"sum": parameters.width + 10 * parameters.inner.depth + chance, "wave": [parameters.width, chance]}

    result = per_case(solve)(block)
    found = {"numbers": {name: [str(part) for part in row] for name, row in numbers_of(Outer()).items()}}
    found |= {"forced": sorted(numbers_of(Outer(force=3.0))), "notes": base.notes_of((Outer(), [Outer(width=0.1)]))}
    found |= {name: block.column(name) for name in ("inner.depth", "width", "inner.count", "flag")}
    found |= {"object": [str(each) for each in block.column("places")], "case": str(block.case(1))}
    found |= {"part": str(block.part(2, 5)), "units": [str(base.unit_of(Outer, name)) for name in Outer.model_fields]}
    found |= {"values": result.values, "messages": [str(each) for each in result.messages.items()]}
    found |= {"status": [status.name for status in map(Status, result.status.ravel())], "solves": result.solves}
    found |= {
        "statuses": [f"{status.name} {status.value}" for status in Status],
        "empty": Result({}, np.zeros(1)).solves,
    }
    found |= {"canonical": [repr(float(base.canonical(each))) for each in (0.1, 1 / 3, -7e20, 1 + 2**-43, 1 + 2**-46)]}
    found |= {"unquoted": [repr(base.unquoted(each)) for each in ("12", "-3", "1.5", "9" * 19, 4)]}
    for value in (0.0, 1e-30, 0.9e-30, 1e30, 1.1e30, (0.1, 1e31)):
        try:
            found[f"size {value}"] = str(base._conceivable(base.LEAST, value))
        except ValueError as error:
            found[f"size {value}"] = str(error)
    for given in ({"width": "0.5"}, {"widht": 0.5}, {"width": np.inf}, {"inner": {"count": 2.5}}):
        with pytest.raises(ValueError, match="1 validation error for Outer"):
            Outer(**given)
    with pytest.raises(ValueError, match="frozen"):
        Outer().width = 0.7
    with pytest.raises(ValueError, match="too shallow"):
        per_case(solve)(block.part(2, 0))
    record.check(dataframe_regression, flat("", found))


class Sizes(BaseModel):
    share: float = base.quantity("1", "a pure number")
    length: float = base.quantity("m", "a length")
    factor: float = base.quantity("m^(1-n)", "of a body r^n")


def test_sizes_that_no_quantity_has_are_refused_of_quantities_alone():
    assert Sizes(share=1e-200, length=1e-29, factor=1e200).factor == 1e200
    with pytest.raises(
        ValueError, match=r"length.*\n.*expected a size between 1e-30 and 1e\+30 in SI units, got 1e-200"
    ):
        Sizes(share=1, length=1e-200, factor=1)


def test_files_that_are_no_tables_tell_nothing(tmp_path):
    path = tmp_path / "long.csv"
    path.write_text("x [m],z [m]\n0,1\n1,2\n")
    file = DataFile(name="long.csv", path=str(path), sha256="")
    assert LARGEST_TABLE == 10**7
    with path.open("r+b") as longer:
        longer.truncate(LARGEST_TABLE)
    assert file.notes() == ()
