"""The keys of a campaign file that do not depend on the model."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag

from mdr_dask.campaign.document import LARGEST
from mdr_dask.models.base import Parameters, Whole, quantity
from mdr_dask.models.data_file import NamedFile

_LONGEST_NAME = 100  # file systems allow 255 bytes, and endings are added to the name


def _usable_as_file_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*", name) or name.endswith("."):
        raise ValueError(f"expected a file name of letters, digits, '-', '_' and '.', got {name!r}")
    if len(name) > _LONGEST_NAME:
        raise ValueError(f"expected a file name with at most {_LONGEST_NAME} characters, got {len(name)}")
    if name.endswith((".partial", ".json")):
        raise ValueError(f"expected a file name with another ending, got {name!r}")
    return name


FileName = Annotated[str, AfterValidator(_usable_as_file_name)]


class ToleranceSpec(Parameters):
    """The largest accepted relative and absolute error of an output."""

    relative: float = quantity("1", "largest relative error, such as 1 %", default=0.0, ge=0)
    absolute: float | str = Field(0.0, description="largest error in the unit of the output, such as 2 um")


class AdaptiveSpec(Parameters):
    """A number of realisations that grows for each case until the standard errors of the case are small enough."""

    at_least: Whole = Field(20, ge=2, description="number of realisations that every case gets")
    at_most: Whole = Field(description="largest number of realisations that a case may get", ge=2)
    until: dict[str, float | str | ToleranceSpec] = Field(
        min_length=1,
        description="largest accepted standard error of each named output: 1 %, or {relative: 1 %, absolute: 2 um}",
    )


class RefinedSpec(Parameters):
    """An adaptive axis: the study chooses its values so that outputs can be interpolated between them."""

    adaptive: list[Any] = Field(description="first and last value of the axis")
    until: float | str | dict[str, float | str | ToleranceSpec] = Field(
        description="largest accepted interpolation error: 1 % allows 1 % of the largest absolute value along the "
        "axis, for the first output with a single number for each case; "
        "{friction_coefficient: 1 %, indentation_depth: {absolute: 2 um}} sets the error of each named output"
    )
    at_most: Whole = Field(
        60,
        ge=5,
        le=10**4,
        description="largest number of values of the axis, for each combination of values of the other axes",
    )


class SobolSpec(Parameters):
    """Cases drawn as a scrambled Sobol sequence."""

    sobol: Whole = Field(
        ge=1, le=LARGEST, description="number of cases, drawn from the ranges as a scrambled Sobol sequence"
    )


class LatinHypercubeSpec(Parameters):
    """Cases drawn as a Latin hypercube."""

    latin_hypercube: Whole = Field(
        ge=1,
        le=LARGEST,
        description="number n of cases, drawn as a Latin hypercube: one case in each of n intervals of every range",
    )


class SaltelliSpec(Parameters):
    """Cases of Saltelli's design for Sobol indices."""

    saltelli: Whole = Field(
        ge=2,
        le=10**5,
        description="number n of base points of the design of Saltelli for `mdr-dask sensitivity`; d varied parameters "
        "give n (d + 2) cases",
    )


Drawn = SobolSpec | LatinHypercubeSpec | SaltelliSpec


class TableSpec(Parameters):
    """Cases from a table."""

    table: str = Field(
        description="name of a CSV file, relative to the campaign file, with one case in each line. The heading of a "
        "column is the dotted name of a parameter, if needed with a unit: velocity [mm/s]"
    )


def _sampling_kind(value: Any) -> str:
    if isinstance(value, dict) and len(value) == 1:
        return str(next(iter(value)))
    return "name"


Sampling = Annotated[
    Annotated[Literal["grid", "zip"], Tag("name")]
    | Annotated[SobolSpec, Tag("sobol")]
    | Annotated[LatinHypercubeSpec, Tag("latin_hypercube")]
    | Annotated[SaltelliSpec, Tag("saltelli")]
    | Annotated[TableSpec, Tag("table")],
    Discriminator(_sampling_kind, custom_error_type="sampling", custom_error_message=(
        "Input should be 'grid', 'zip', {sobol: n}, {latin_hypercube: n}, {saltelli: n} or "
        "{table: cases.csv}"
    )),
]  # fmt: skip

Realisations = Annotated[
    Annotated[Whole, Field(ge=1), Tag("number")] | Annotated[AdaptiveSpec, Tag("mapping")],
    Discriminator(lambda value: "mapping" if isinstance(value, dict | AdaptiveSpec) else "number"),
]


class StoreSpec(Parameters):
    """The store of the results: its path and its chunks."""

    path: str | None = Field(
        None,
        min_length=1,
        description="path or URL of the Zarr store that receives the results; by default results/<name>.zarr",
    )
    blocks: dict[str, Annotated[Whole, Field(ge=1)]] = Field(
        default_factory=dict,
        description="number of values in a chunk, along an axis or along realisation; chosen automatically by default",
    )


class MeasuredSpec(Parameters):
    """Measured points, to find unknown parameters."""

    table: NamedFile = Field(
        description="name of a table, relative to the campaign file, with units in brackets. Its columns are "
        "conditions of the test, one measured output, and optionally the standard_error of this output"
    )


class CampaignSpec(Parameters):
    """The keys of a campaign file."""

    name: FileName = Field(description="name of the campaign, and of its store unless store gives another path")
    model: str = Field(description="name of the model that computes the results")
    seed: Whole = Field(0, ge=0, description="seed of all random numbers; the same seed gives the same results")
    realisations: Realisations = Field(
        1, description="number of random samples of each case, such as independent rough lines with the same statistics"
    )
    parameters: dict[str, Any] = Field(
        description="parameters of the model. A list, {linear: [a, b, n]}, {geometric: [a, b, n]}, {values: [...]} or "
        "{adaptive: [a, b], until: 1 %} varies a parameter"
    )
    series: dict[FileName, dict[str, Any]] | None = Field(
        None,
        min_length=1,
        description="named groups of cases; in each group, the given parameters replace those under `parameters`",
    )
    sampling: Sampling = Field("grid", description="how the values of the varied parameters are combined into cases")
    measured: MeasuredSpec | None = Field(
        None,
        description="measured points for `mdr-dask fit STORE calibration`, which finds the varied parameters that are "
        "not columns of the table",
    )
    accuracy: float | None = quantity(
        "1", "largest accepted discretisation error of every output, relative to its value", default=None, gt=0, lt=1
    )
    outputs: Annotated[list[str], Field(min_length=1)] | None = Field(
        None,
        description="outputs to compute; without this key, the default outputs of the model",
    )
    errors: bool = Field(
        True,
        description="whether to store the estimated discretisation error of each output as <output>_error; false saves "
        "the time to estimate it",
    )
    store: StoreSpec = Field(default_factory=StoreSpec, description="the store of the results")
