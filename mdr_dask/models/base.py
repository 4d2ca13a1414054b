"""The interface of models. A model declares its parameters and outputs, and computes a block by a pure function."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import partial, reduce
from importlib import import_module
from typing import Annotated, Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from mdr_dask.arrays import FloatArray


class Status(IntEnum):
    """The state of one case in one realisation, as stored in the ``status`` array of a store."""

    MISSING = 0
    DONE = 1
    NOT_CONVERGED = 2
    FAILED = 3
    NOT_NEEDED = 4


Alternatives = tuple[tuple[str, ...], ...]
_WHOLE = re.compile(r"[+-]?\d{1,18}")


def unquoted(value: Any) -> Any:
    """Convert a whole number in quotes to a number. Return anything else unchanged."""
    return int(value) if isinstance(value, str) and _WHOLE.fullmatch(value) else value


#: A whole number. Quotes around the number are allowed, because numbers with a unit are also written in quotes.
Whole = Annotated[int, BeforeValidator(unquoted)]


class Parameters(BaseModel):
    """Base class of every parameter set. Quantities are checked against their bounds.

    When a campaign is read, quantities with a unit are first converted to SI units.

    A parameter set cannot be changed, and unknown keys are errors. A subclass may declare:

    * `renamed`: earlier names of parameters and outputs, each with a text that says what to write now.
    * `alternatives`: groups of alternatives. A user gives exactly one alternative of each group. For example, the group
    ``(("length", "rms_roughness"), ("profile",))`` requires either `length` together with `rms_roughness`, or
    `profile`. A nested parameter is written with dots, such as ``"indenter.radius"``.
    * `overrides`: ``{"history": "cycles"}`` means that `cycles` has no effect when `history` is given.
    * `settings`: parameters of the numerical solution that do not change the physical problem, such as a resolution.
    * `requires`: ``{"xi": ("wear_rule", "fast")}`` means that `xi` has an effect only with ``wear_rule: fast``.
    """

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)
    renamed: ClassVar[Mapping[str, str]] = {}
    alternatives: ClassVar[tuple[Alternatives, ...]] = ()
    overrides: ClassVar[Mapping[str, str]] = {}
    settings: ClassVar[frozenset[str]] = frozenset()
    requires: ClassVar[Mapping[str, tuple[str, str]]] = {}

    def require_one_alternative(self) -> None:
        """Raise ValueError unless exactly one alternative of each group is given.

        Names with dots, for nested parameters, are not supported here.
        """
        for group in self.alternatives:
            given = {name for member in group for name in member if getattr(self, name) is not None}
            if not any(given == set(member) for member in group):
                raise ValueError(f"expected {describe(group)}, got {' and '.join(sorted(given)) or 'none'}")

    @property
    def inactive(self) -> dict[str, str]:
        """The parameters that another parameter overrides, each with the name of the parameter that overrides it."""
        return {other: name for name, other in self.overrides.items() if getattr(self, name) not in (None, ())}


def describe(group: Alternatives) -> str:
    """Return a group of alternatives as text, such as ``length with rms_roughness, or profile``."""
    return ", or ".join(f"{first} with {', '.join(others)}" if others else first for first, *others in group)


def _looks_numeric(value: Any) -> bool:
    return isinstance(value, str) and value.strip()[:1] in "+-.0123456789" and value.strip() != ""


#: Smallest and largest allowed absolute value of a quantity in SI units. The value 0 is also allowed. For pure numbers,
#: only the upper limit applies. A product of ten numbers between these limits neither overflows nor underflows.
LEAST, MOST = 1e-30, 1e30


def quantity(unit: str, description: str, usual: str = "", **bounds: Any) -> Any:
    """Declare a physical parameter, as in ``length: float = quantity("m", "length of the line", gt=0)``.

    `unit` is the coherent SI unit, or ``"1"`` for a pure number. `usual` is a common value with its unit, such as
    ``"10 MPa"``. ``mdr-dask init`` writes this value into a new campaign file. Further values after commas, as in
    ``"2 GPa, 200 HV"``, show other common units of the quantity. If a campaign gives a number without a unit, and the
    number in one of these units would be closer to the first value than the number in SI, ``check`` asks for the unit.
    The other arguments, such as ``default``, ``gt`` and ``le``, are passed to :func:`pydantic.Field`.
    """

    def to_si(value: Any, info: ValidationInfo) -> Any:
        """Convert a text such as ``20 mm``, or each text in a list, to a number in SI units.

        A name such as ``auto`` is returned unchanged. If no campaign is being read, only whole numbers are converted.
        """
        if isinstance(value, list | tuple):
            return tuple(to_si(item, info) for item in value)
        value = unquoted(value)
        return info.context["to_si"](value, unit) if info.context and _looks_numeric(value) else value

    examples = usual.split(", ") if usual else None
    field = Field(description=description, json_schema_extra={"unit": unit}, examples=examples, **bounds)
    field.metadata.append(BeforeValidator(to_si))
    if unit != "m^(1-n)":  # no limits for the coefficient c of a body c r^n, because its SI value depends strongly on n
        field.metadata.append(AfterValidator(partial(_conceivable, 0.0 if unit == "1" else LEAST)))
    return field


def _conceivable(least: float, value: Any) -> Any:
    """Return `value`, or raise ValueError if products of numbers of such a size could overflow or underflow."""
    for number in value if isinstance(value, tuple) else (value,):
        if isinstance(number, float) and number != 0 and not least <= abs(number) <= MOST:
            raise ValueError(f"expected an absolute value between {least:g} and {MOST:g} in SI units, got {number:.9g}")
    return value


def unit_of(parameters: type[BaseModel], name: str) -> str | None:
    """Return the SI unit of a field, or None if the field is not a quantity."""
    extra = parameters.model_fields[name].json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) and "unit" in extra else None


def notes_of(parameters: Any) -> tuple[str, ...]:
    """Return the notes of a parameter set, or of a list of them, and of all nested sets, for example about tables."""
    notes: tuple[str, ...] = ()
    if isinstance(parameters, list | tuple):
        return tuple(note for part in parameters for note in notes_of(part))
    if isinstance(parameters, BaseModel):
        notes = tuple(note for name in type(parameters).model_fields for note in notes_of(getattr(parameters, name)))
        own = getattr(type(parameters), "notes", None)
        notes += own(parameters) if callable(own) else ()
    return notes


#: Dimensionless numbers are rounded to this number of bits; a double has 53 bits. Numbers whose relative
#: difference is much less than 2^-44, about 6e-14, nearly always become equal and then share one solution.
CANONICAL_BITS = 44


def canonical(number: ArrayLike) -> Any:
    """Round dimensionless numbers, so that numbers that differ only by rounding errors nearly always become equal."""
    mantissa, exponent = np.frexp(number)
    return np.ldexp(np.rint(np.ldexp(mantissa, CANONICAL_BITS)), exponent - CANONICAL_BITS)


def deferred(module: str, name: str) -> Callable[..., Any]:
    """Return a function that imports and calls the function `name` of `module`.

    `module` is imported only at the first call, so that declarations load quickly.
    """

    def call(*arguments: Any) -> Any:
        return getattr(import_module(module), name)(*arguments)

    return call


P = TypeVar("P", bound=Parameters)


@dataclass(frozen=True)
class Output:
    """One array that a model can compute.

    * `unit` and `long_name`: SI unit (``"1"`` for a pure number) and meaning of the output.
    * `dims`: dimensions of the output for a single case, such as ``("radius",)``. ``Model.coordinates`` gives the
    coordinates of these dimensions.
    * `default`: whether the output is computed if the campaign names no outputs.
    * `has_error`: whether the solver estimates the discretisation error of the output. The error is stored as a second
    output, the companion ``<name>_error``, unless the campaign has ``errors: false``.
    * `comment`: a limitation of the output, stored as its attribute ``comment``.
    * `scatter`: name of another output, which contains the standard error of the output, estimated within each
    realisation. If errors are stored, this standard error is stored, too.
    * `allow_nan`: whether NaN and infinite values are valid. If `allow_nan` is False, a case of a user's own model
    fails if this output is NaN or infinite.
    """

    name: str
    unit: str
    long_name: str
    dims: tuple[str, ...] = ()
    default: bool = True
    has_error: bool = False
    comment: str = ""
    scatter: str = ""
    allow_nan: bool = False

    @property
    def error(self) -> Output:
        """The companion ``<name>_error``: the estimated absolute discretisation error, in the unit of the output."""
        meaning = f"estimated absolute discretisation error, {self.long_name}"
        return Output(f"{self.name}_error", self.unit, meaning, self.dims, self.default, allow_nan=self.allow_nan)


@dataclass(frozen=True)
class Number:
    """A dimensionless number that is computed for each case.

    Users can write its name in conditions and as the name of a column in a table. The module
    `mdr_dask.questions.expression` evaluates `formula`. The formula may contain outputs, other numbers and parameters.
    In a formula, the nested parameter ``indenter.angle`` is called ``indenter_angle``.
    """

    name: str
    formula: str
    meaning: str


@dataclass(frozen=True)
class Coordinate:
    """The values along a dimension of an output, and the unit and the meaning of these values."""

    values: FloatArray
    unit: str
    long_name: str


@dataclass(frozen=True)
class Block(Generic[P]):
    """Several cases, each with the same realisations.

    One Dask task computes the block and writes one chunk of every array.

    * `parameters`: a parameter set with the values of the fixed parameters. In this set, a varied parameter has the
    value of an arbitrary case. The method `column` returns the values for all cases.
    * `columns`: for the dotted path of each varied parameter (such as ``velocity`` or ``indenter.angle``), an array
    with one value in SI units for each case.
    * `realisations`: indices of the realisations. All random numbers of a realisation follow from its index and `seed`.
    * `outputs`: names of the arrays to compute, including the companions that hold errors.
    * `accuracy`: largest allowed relative discretisation error of every output with `has_error`, or None if the
    campaign gives no accuracy. For an output that can be zero, the model may set a floor. If the output is below its
    floor, the error is divided by the floor.
    """

    parameters: P
    columns: Mapping[str, NDArray[Any]]
    cases: int
    realisations: tuple[int, ...]
    seed: int
    outputs: tuple[str, ...]
    accuracy: float | None = None

    def column(self, path: str) -> NDArray[Any]:
        """Return the values of a varied or fixed parameter for all cases, shape (cases,)."""
        if path in self.columns:
            return self.columns[path]
        value: Any = reduce(getattr, path.split("."), self.parameters)
        if isinstance(value, bool | int | float):
            return np.full(self.cases, value)
        column = np.empty(self.cases, dtype=object)
        column[:] = [value] * self.cases
        return column

    def numbers(self, name: str) -> FloatArray:
        """Return the value of a parameter for every case, or NaN for a case in which the parameter is not given."""
        given = self.columns.get(name, np.full(self.cases, getattr(self.parameters, name)))
        return np.asarray(given, dtype=np.float64)  # None becomes NaN

    def case(self, index: int) -> P:
        """Return the parameter set of one case."""
        case = self.parameters
        for path, column in self.columns.items():
            value = column[index]
            case = with_value(case, path, value.item() if isinstance(value, np.generic) else value)
        return case

    def part(self, index: int, realisation: int) -> Block[P]:
        """Return the block of one case in one realisation. `realisation` is one of the `realisations` of this block."""
        columns = {path: column[index : index + 1] for path, column in self.columns.items()}
        return Block(self.parameters, columns, 1, (realisation,), self.seed, self.outputs, self.accuracy)


def with_value(parameters: Any, path: str, value: Any) -> Any:
    """Return a copy of a parameter set in which the parameter at a dotted path has the value `value`."""
    name, _, rest = path.partition(".")
    if rest:
        value = with_value(getattr(parameters, name), rest, value)
    return parameters.model_copy(update={name: value})


@dataclass(frozen=True)
class Result:
    """The return value of a model for a block.

    * `values`: the requested arrays, shape (cases, realisations, ...). The values of a failed case are NaN.
    * `status`: values of `Status`, shape (cases, realisations).
    * `messages`: reasons for failures, and warnings about results. The key is (index of the case, position of the
    realisation in `Block.realisations`).
    * `solves`: number of computed solutions. Several cases may share one solution.
    """

    values: dict[str, FloatArray]
    status: NDArray[np.int8]
    messages: dict[tuple[int, int], str] = field(default_factory=dict)
    solves: int = 0

    def add_message(self, case: int, realisation: int, message: str) -> None:
        """Append a message to the messages of a case. `realisation` is the position of the realisation in the block."""
        before = self.messages.get((case, realisation))
        self.messages[case, realisation] = f"{before}; {message}" if before else message


@dataclass(frozen=True)
class Model(Generic[P]):
    """A computation that a campaign can name.

    * `version`: a number that is increased whenever a change of the code changes results. A store can be extended only
    by the model version that created the store.
    * `summary`: one line for ``mdr-dask models``.
    * `outputs`: all arrays that the model can compute, except ``status`` and the companions that hold errors.
    * `compute`: a pure function. The outputs of a case depend on the parameters of the case, the seed and the
    realisation, but not on the other cases of the block. If a case fails, the function raises no exception, but
    returns the status and the reason in `Result`.
    * `operations`: a fast function that returns the approximate number of floating-point operations of a block. This
    number determines the sizes of blocks. If `operations` is None, a study with n results is divided into about sqrt(n)
    blocks.
    * `whole`: parameters whose axes are not divided among blocks if possible, because the cases along such an axis
    share work. If a block would be too large, the axis of the last parameter in `whole` is divided first.
    * `coordinates`: a function that returns the coordinates of all dimensions in `Output.dims`.
    * `units`: a function that returns the actual unit of each output or parameter whose declared unit does not apply,
    as in a dimensionless campaign.
    * `notes`: a function that returns notes for ``check`` about a study. The argument is a sequence of parameter sets,
    one for each tried value of each axis. A nested parameter set can have its own method `notes`.
    """

    name: str
    version: int
    summary: str
    parameters: type[P]
    outputs: tuple[Output, ...]
    compute: Callable[[Block[P]], Result]
    operations: Callable[[Block[P]], float] | None = None
    whole: tuple[str, ...] = ()
    coordinates: Callable[[P], dict[str, Coordinate]] = lambda _: {}
    units: Callable[[P], dict[str, str]] = lambda _: {}
    notes: Callable[[Sequence[P]], tuple[str, ...]] = lambda _: ()
    numbers: tuple[Number, ...] = ()

    @property
    def companions(self) -> dict[str, Output]:
        """The companion of every output that has an error.

        The keys are the names of the outputs, not of the companions.
        """
        return {output.name: output.error for output in self.outputs if output.has_error}

    def output(self, name: str) -> Output:
        """Return the output or the companion that is called `name`. Raise KeyError if there is none."""
        return {output.name: output for output in (*self.outputs, *self.companions.values())}[name]

    def empty_arrays(self, block: Block[P], shape: tuple[int, ...]) -> dict[str, FloatArray]:
        """Return an array of NaN for each requested output. `shape` is the shape of an output without dimensions."""
        along = self.coordinates(block.parameters)
        sizes = {name: tuple(along[dim].values.size for dim in self.output(name).dims) for name in block.outputs}
        return {name: np.full((*shape, *size), np.nan) for name, size in sizes.items()}

    def with_companions(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return `names` and the names of their `scatter` outputs, in the order of `Model.outputs`.

        Each name is followed by the name of its companion, if any.
        """
        companions = self.companions
        asked = {*names, *(self.output(name).scatter for name in names)}
        kept = [output.name for output in self.outputs if output.name in asked]
        return tuple(
            each for name in kept for each in ((name, companions[name].name) if name in companions else (name,))
        )
