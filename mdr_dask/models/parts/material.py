"""Linear viscoelastic materials as a campaign names them."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import NamedFile, Parameters, quantity
from mdr_dask.tables import Column, read_table

if TYPE_CHECKING:
    from mdr_dask.physics.solids import LinearSolid, SeriesFit

Numbers = Annotated[tuple[float, ...], Field(strict=False)]
SAME_TEMPERATURE = 1.0  # K: what an instrument scatters about its set point


class Kelvin(Parameters):
    """A spring and a dashpot side by side."""

    shear_modulus: float = quantity("Pa", "shear modulus G", gt=0)
    relaxation_time: float = quantity("s", "relaxation time tau = eta / G", gt=0)


class StandardSolid(Parameters):
    """A spring beside one relaxing arm."""

    static_modulus: float = quantity("Pa", "shear modulus of slow deformation", gt=0)
    glass_modulus: float = quantity("Pa", "shear modulus of sudden deformation, above the static one", gt=0)
    relaxation_time: float = quantity("s", "relaxation time of the arm", gt=0)


class PronySeries(Parameters):
    """A spring beside any number of relaxing arms and perhaps a dashpot."""

    static_modulus: float = quantity("Pa", "shear modulus of slow deformation", gt=0)
    moduli: Numbers = quantity("Pa", "shear modulus of each arm")
    times: Numbers = quantity("s", "relaxation time of each arm")
    viscosity: float = quantity("Pa s", "viscosity of the dashpot", default=0.0, ge=0)

    @model_validator(mode="after")
    def _a_time_for_every_modulus(self) -> PronySeries:
        if len(self.moduli) != len(self.times):
            raise ValueError(f"expected a time for every modulus, got {len(self.times)} and {len(self.moduli)}")
        return self


class PowerLaw(Parameters):
    """A Prony series whose loss modulus is a power of the frequency."""

    static_modulus: float = quantity("Pa", "shear modulus of slow deformation", gt=0)
    loss_modulus: float = quantity("Pa", "loss modulus G'' at the frequency given", gt=0)
    frequency: float = quantity("rad/s", "angular frequency at which the loss modulus holds", gt=0)
    exponent: float = quantity("1", "exponent beta of G'' ~ omega^beta", gt=0, lt=1)
    lowest: float = quantity("rad/s", "lowest angular frequency of the law", gt=0)
    highest: float = quantity("rad/s", "highest angular frequency of the law", gt=0)


class ModulusTable(Parameters):
    """A Prony series fitted to a table of frequency, storage and loss modulus, and perhaps temperature."""

    file: NamedFile = Field(
        description="table with columns frequency, storage modulus, loss modulus or tan delta, and perhaps temperature"
    )
    frequency_unit: str = Field(default="", description="unit of the frequencies, where the table does not say")
    modulus_unit: str = Field(default="", description="unit of the moduli, where the table does not say")
    table_temperature: float | None = quantity(
        "K",
        "measured temperature to use; tables of several are otherwise superposed at `reference`",
        default=None,
        gt=0,
    )
    reference: float | None = quantity("K", "temperature to superpose at", default=None, gt=0)
    poisson_ratio: float | None = quantity(
        "1", "given where the moduli are of tension: divides them by 2 (1 + nu)", default=None, ge=-1, le=0.5
    )
    arms_per_decade: float = quantity("1", "density of relaxation times", default=1.0, gt=0, le=5)

    @model_validator(mode="after")
    def _holds_moduli(self, info: ValidationInfo) -> ModulusTable:
        """Refuse a bad table where a campaign names it, before any case fails of it."""
        if info.context is not None:
            try:
                _columns(self)
            except DataError as problem:
                raise ValueError(str(problem)) from None
        return self


class Wlf(Parameters):
    """Temperature by Williams, Landel and Ferry."""

    c1: float = quantity("1", "constant c1 of the law", gt=0)
    c2: float = quantity("K", "constant c2 of the law", gt=0)
    reference: float = quantity("K", "temperature at which the relaxation times hold", gt=0)


class Arrhenius(Parameters):
    """Temperature by an activation energy."""

    activation_energy: float = quantity("J/mol", "activation energy", gt=0)
    reference: float = quantity("K", "temperature at which the relaxation times hold", gt=0)


KINDS = ("kelvin", "standard_solid", "prony", "power_law", "dma_table")


class Material(Parameters):
    """One linear viscoelastic material, and perhaps its temperature."""

    kelvin: Kelvin | None = Field(default=None, description="spring and dashpot")
    standard_solid: StandardSolid | None = Field(default=None, description="spring and one relaxing arm")
    prony: PronySeries | None = Field(default=None, description="spring and any number of relaxing arms")
    power_law: PowerLaw | None = Field(default=None, description="loss modulus as a power of frequency")
    dma_table: ModulusTable | None = Field(default=None, description="fit to measured moduli")
    temperature: float | None = quantity("K", "temperature, with wlf or arrhenius", default=None, gt=0)
    wlf: Wlf | None = Field(default=None, description="shift of relaxation times by Williams, Landel and Ferry")
    arrhenius: Arrhenius | None = Field(default=None, description="shift of relaxation times by an activation energy")

    @model_validator(mode="after")
    def _one_of_each(self) -> Material:
        kinds = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(kinds) != 1:
            raise ValueError(f"expected one of {', '.join(KINDS)}, got {', '.join(kinds) or 'none'}")
        if self.wlf is not None and self.arrhenius is not None:
            raise ValueError("expected wlf or arrhenius, got both")
        if (self.temperature is None) != (self.wlf is None and self.arrhenius is None):
            raise ValueError("a temperature needs wlf or arrhenius, and these need a temperature")
        return self


@lru_cache(maxsize=256)
def solid_of(material: Material) -> LinearSolid:
    """Return the material's springs, arms and dashpot at its temperature.

    Raises
    ------
    DataError, ValueError
        If the numbers do not make a solid or the table cannot be fitted.
    """
    from mdr_dask.physics import solids as rheology

    solid = _solid(material)
    if material.temperature is None:
        return solid
    if material.wlf is not None:
        law = material.wlf
        factor = rheology.wlf_factor(material.temperature, law.reference, law.c1, law.c2)
    else:
        assert material.arrhenius is not None
        shift = material.arrhenius
        factor = rheology.arrhenius_factor(material.temperature, shift.reference, shift.activation_energy)
    return rheology.at_temperature(solid, float(factor))


def _solid(material: Material) -> LinearSolid:
    from mdr_dask.physics import solids as rheology

    if material.kelvin is not None:
        return rheology.kelvin(material.kelvin.shear_modulus, material.kelvin.relaxation_time)
    if material.standard_solid is not None:
        one = material.standard_solid
        return rheology.standard_solid(one.static_modulus, one.glass_modulus, one.relaxation_time)
    if material.prony is not None:
        arms = material.prony
        return rheology.prony(arms.static_modulus, arms.moduli, arms.times, arms.viscosity)
    kind = material.power_law or material.dma_table
    assert kind is not None
    return _fit_of(kind).solid


@lru_cache(maxsize=256)
def _fit_of(kind: PowerLaw | ModulusTable) -> SeriesFit:
    from mdr_dask.physics import solids as rheology

    if isinstance(kind, PowerLaw):
        numbers = kind.static_modulus, kind.loss_modulus, kind.frequency, kind.exponent, kind.lowest, kind.highest
        return rheology.power_law_series(*numbers)
    omega, storage, loss = _moduli(kind)
    divisor = 1.0 if kind.poisson_ratio is None else 2 * (1 + kind.poisson_ratio)
    return rheology.fit_series(omega, storage / divisor, loss / divisor, kind.arms_per_decade)


def fit_error(material: Material | None) -> float:
    """Return the rms relative error of the Prony series that stands for a law or a table; 0 for other materials.

    Raises as `solid_of` does.
    """
    kind = None if material is None else material.power_law or material.dma_table
    return 0.0 if kind is None else _fit_of(kind).error


def fit_notes(material: Material | None) -> tuple[str, ...]:
    """Return how well the Prony series of a law or a table holds, in one sentence, if there is one."""
    kind = None if material is None else material.power_law or material.dma_table
    if kind is None:
        return ()
    try:
        fit = _fit_of(kind)
    except (DataError, ValueError):
        return ()  # every case will say so
    what = "power law" if isinstance(kind, PowerLaw) else f"table {kind.file.name}"
    lowest, highest = fit.range
    errors = [f"{error:.1%} in {modulus}" for modulus, error in _errors(fit).items()]
    return (
        f"{what}: {fit.solid.times.size} arms for {lowest:.3g} to {highest:.3g} rad/s, rms error {', '.join(errors)}, "
        f"largest {fit.largest_error:.1%} at {fit.worst_frequency:.3g} rad/s",
    )


def _errors(fit: SeriesFit) -> dict[str, float]:
    both = {"G'": fit.storage_error, "G''": fit.loss_error}
    return {modulus: error for modulus, error in both.items() if np.isfinite(error)}


def _moduli(chosen: ModulusTable) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return angular frequency, storage and loss modulus in SI, at one temperature."""
    omega, storage, loss, temperature = _columns(chosen)
    if temperature is None or np.ptp(temperature) < SAME_TEMPERATURE:
        return omega, storage, loss
    if chosen.table_temperature is not None:
        near = np.abs(temperature - chosen.table_temperature) <= SAME_TEMPERATURE
        return omega[near], storage[near], loss[near]
    return _superposed(chosen, temperature, omega, storage, loss)


def _columns(chosen: ModulusTable) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray | None]:
    """Return angular frequency, storage and loss modulus and perhaps temperature in SI, as the file has them."""
    table = read_table(chosen.file.read_text(), chosen.file.name, _dma_columns(chosen))
    omega, storage, loss = (table.get(name) for name in ("frequency", "storage modulus", "loss modulus"))
    assert omega is not None
    assert storage is not None
    if loss is None and "tan delta" in table:
        loss = storage * table["tan delta"]
    if loss is None:
        raise DataError(f"{chosen.file.name}: expected a column loss modulus or tan delta")
    temperature = table.get("temperature")
    if temperature is not None and np.ptp(temperature) >= SAME_TEMPERATURE:
        if chosen.table_temperature is None and chosen.reference is None:
            raise DataError(
                f"{chosen.file.name}: has several temperatures: name one by table_temperature, or a reference"
            )
        wanted = chosen.table_temperature
        if wanted is not None and np.count_nonzero(np.abs(temperature - wanted) <= SAME_TEMPERATURE) < 2:
            raise DataError(f"{chosen.file.name}: got no rows at {wanted:g} K")
    return omega, storage, loss, temperature


def _dma_columns(chosen: ModulusTable) -> tuple[Column, ...]:
    """Return the columns of a dynamic-mechanical analysis, by the names that machines and people give them."""
    storage = ("E'", "G'", "storage", "E stor", "G stor", "Estor", "Gstor", "E1", "G1")
    loss = ("E''", "G''", "loss", "E loss", "G loss", "Eloss", "Gloss", "E2", "G2")
    temperature = ("T", "temp", "temp.", "sample temperature")
    frequency = ("f", "freq", "freq.", "omega", "angular frequency", "w", "ω")
    return (
        Column("frequency", "rad/s", frequency, above=0, given_unit=chosen.frequency_unit),
        Column("storage modulus", "Pa", storage, above=0, given_unit=chosen.modulus_unit),
        Column("loss modulus", "Pa", loss, needed=False, above=0, given_unit=chosen.modulus_unit),
        Column("temperature", "K", temperature, needed=False, above=0),
        Column("tan delta", "1", ("tan(delta)", "tan d", "tand", "loss factor", "tan δ"), needed=False, above=0),
        Column("set", "1", ("segment", "point", "index", "no"), needed=False),
    )


def _superposed(
    chosen: ModulusTable, temperature: FloatArray, omega: FloatArray, storage: FloatArray, loss: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Shift every temperature to the reference by its storage modulus."""
    from mdr_dask.physics.superposition.master_curve import superpose

    order = np.argsort(temperature, kind="stable")
    member = np.empty(order.size, dtype=np.intp)
    member[order] = np.append(0, np.cumsum(np.diff(temperature[order]) > SAME_TEMPERATURE))
    parts = [member == number for number in range(int(member.max()) + 1)]
    curves = [(np.log10(omega[part]), np.log10(storage[part])) for part in parts]
    found = superpose([temperature[part].mean() for part in parts], curves, reference=chosen.reference)
    return omega * 10 ** found.horizontal[member], storage, loss
