"""The keys of a campaign file that do not depend on the model."""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag

from mdr_dask.models.base import Parameters, quantity, unquoted
from mdr_dask.models.data_file import NamedFile

_LONGEST_NAME = 100


def _usable_as_file_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*", name) or name.endswith("."):
        raise ValueError(f"expected a file name of letters, digits, '-', '_' and '.', got {name!r}")
    if len(name) > _LONGEST_NAME or name.endswith((".partial", ".json")):
        what = f"at most {_LONGEST_NAME} characters" if len(name) > _LONGEST_NAME else "another ending"
        raise ValueError(f"expected a file name with {what}, got {name[:60]!r}")
    return name


FileName = Annotated[str, AfterValidator(_usable_as_file_name)]


class ToleranceSpec(Parameters):
    """Largest error of an output; it is enough to meet one part."""

    relative: float = quantity("1", "relative to the mean, such as 1 %", default=0.0, ge=0)
    absolute: float | str = Field(0.0, description="in the unit of the output, such as 2 um")


class AdaptiveSpec(Parameters):
    """Realisations until the standard errors are small enough."""

    at_least: int = Field(20, ge=2, description="number of realisations of every case")
    at_most: int = Field(description="largest number of realisations of a case", ge=2)
    until: dict[str, float | str | ToleranceSpec] = Field(
        min_length=1,
        description="largest standard error of outputs: 1 %, or {relative: 1 %, absolute: 2 um}; or largest half width "
        "of the interval of fitted constants: zone_one.alpha: 0.01, plateau: 2 %",
    )


class RefinedSpec(Parameters):
    """An adaptive axis, whose values the study chooses."""

    adaptive: list[Any] = Field(description="first and last value")
    until: float | str | dict[str, float | str | ToleranceSpec] = Field(
        description="largest error of interpolation, relative to the largest value of the first output: 1 %; or by "
        "output: {friction_coefficient: 1 %, indentation_depth: {absolute: 2 um}}"
    )
    at_most: int = Field(
        60, ge=5, le=10**4, description="largest number of values along the axis, for each case of the other axes"
    )


class SobolSpec(Parameters):
    """Scrambled Sobol points."""

    sobol: int = Field(ge=1, le=10**6, description="number of cases, the points of a scrambled Sobol sequence")


class LatinHypercubeSpec(Parameters):
    """A Latin hypercube."""

    latin_hypercube: int = Field(
        ge=1, le=10**6, description="number of cases, one in each of as many intervals of every range"
    )


class SaltelliSpec(Parameters):
    """Saltelli's design for Sobol indices."""

    saltelli: int = Field(
        ge=2,
        le=10**5,
        description="number n of base points of a design for `mdr-dask sensitivity`: n (d + 2) cases for d varied "
        "parameters",
    )


Drawn = SobolSpec | LatinHypercubeSpec | SaltelliSpec


class TableSpec(Parameters):
    """Cases from a file."""

    table: str = Field(
        description="CSV file, relative to the campaign file: a column for each varied parameter, headed by its "
        "dotted name and perhaps a unit, such as velocity [mm/s]"
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
    Annotated[int, Field(ge=1), Tag("number")] | Annotated[AdaptiveSpec, Tag("mapping")],
    Discriminator(lambda value: "mapping" if isinstance(value, dict | AdaptiveSpec) else "number"),
]


class StoreSpec(Parameters):
    """The store of the results."""

    path: str | None = Field(
        None, min_length=1, description="path or URL of the Zarr store; by default results/<name>.zarr"
    )
    blocks: dict[str, Annotated[int, BeforeValidator(unquoted), Field(ge=1)]] = Field(
        default_factory=dict,
        description="chunk length along an axis or along realisation; chosen automatically by default",
    )


class MeasuredSpec(Parameters):
    """Measured points."""

    table: NamedFile = Field(
        description="table of measured points, relative to the campaign file: columns for conditions, for one output, "
        "and perhaps for its standard_error, with units in brackets"
    )


class CampaignSpec(Parameters):
    """A campaign file."""

    name: FileName = Field(description="name of the campaign and of its store")
    model: str = Field(description="name of the model")
    seed: int = Field(0, ge=0, description="seed of all random numbers")
    realisations: Realisations = Field(
        1, description="number of independent rough lines, or other random samples, for each case"
    )
    parameters: dict[str, Any] = Field(
        description="parameters of the model, varied by a list, {linear: [a, b, n]}, {geometric: [a, b, n]} or "
        "{values: [...]}"
    )
    series: dict[FileName, dict[str, Any]] | None = Field(
        None, min_length=1, description="groups of cases by name, each replacing some of the parameters above"
    )
    sampling: Sampling = Field("grid", description="how varied parameters are combined")
    measured: MeasuredSpec | None = Field(
        None,
        description="measured points for `mdr-dask fit STORE calibration`, which finds the varied parameters that the "
        "table lacks",
    )
    accuracy: float | None = quantity(
        "1", "largest relative discretisation error of every output", default=None, gt=0, lt=1
    )
    outputs: Annotated[list[str], Field(min_length=1)] | None = Field(
        None, description="outputs to compute; by default those marked in the tables of the models"
    )
    errors: bool = Field(
        True,
        description="whether to store the estimated discretisation error of each output as <output>_error; false saves "
        "its computation",
    )
    store: StoreSpec = Field(default_factory=StoreSpec, description="the store of the results")
