"""Parameters of linear viscoelastic materials."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.models.base import Alternatives, Parameters, quantity
from mdr_dask.models.data_file import check_in_campaign
from mdr_dask.models.parts.moduli_table import SAME_TEMPERATURE, ModulusTable, one_curve, vertical_factor
from mdr_dask.models.parts.temperature import Arrhenius, Law, ShiftFactors, Wlf
from mdr_dask.units import shown

if TYPE_CHECKING:
    from mdr_dask.physics.solids import LinearSolid, SeriesFit

Numbers = Annotated[tuple[float, ...], Field(strict=False)]


class Kelvin(Parameters):
    """A spring and a dashpot in parallel."""

    shear_modulus: float = quantity("Pa", "static shear modulus G", usual="10 MPa", gt=0)
    relaxation_time: float = quantity("s", "relaxation time tau = eta / G", usual="1 ms", gt=0)


class StandardSolid(Parameters):
    """A spring and one Prony term in parallel."""

    static_modulus: float = quantity("Pa", "shear modulus under slow deformation", usual="3 MPa", gt=0)
    glass_modulus: float = quantity(
        "Pa", "shear modulus under sudden deformation, larger than static_modulus", usual="1 GPa", gt=0
    )
    relaxation_time: float = quantity("s", "relaxation time of the Prony term", usual="1 ms", gt=0)


class PronySeries(Parameters):
    """A spring and any number of Prony terms in parallel, with or without a dashpot."""

    static_modulus: float = quantity("Pa", "shear modulus under slow deformation", usual="3 MPa", gt=0)
    moduli: Numbers = quantity("Pa", "shear modulus of each Prony term", usual="10 MPa")
    times: Numbers = quantity("s", "relaxation time of each Prony term", usual="1 ms")
    viscosity: float = quantity(
        "Pa s", "viscosity of a dashpot in parallel with the spring", usual="10 kPa s", default=0.0, ge=0
    )

    @model_validator(mode="after")
    def _a_time_for_every_modulus(self) -> PronySeries:
        if len(self.moduli) != len(self.times):
            raise ValueError(
                f"expected as many times as moduli, got {len(self.times)} times and {len(self.moduli)} moduli"
            )
        return self


class PowerLaw(Parameters):
    """A Prony series fitted to a solid whose loss modulus is a power of the frequency."""

    static_modulus: float = quantity("Pa", "shear modulus under slow deformation", usual="3 MPa", gt=0)
    loss_modulus: float = quantity("Pa", "loss modulus G'' at the given frequency", usual="1 MPa", gt=0)
    frequency: float = quantity("rad/s", "angular frequency at which loss_modulus is given", usual="1000 rad/s", gt=0)
    exponent: float = quantity("1", "exponent beta of G'' ~ omega^beta", usual="0.2", gt=0, lt=1)
    lowest: float = quantity("rad/s", "lowest angular frequency at which the power law holds", usual="0.1 rad/s", gt=0)
    highest: float = quantity(
        "rad/s", "highest angular frequency at which the power law holds", usual="1e5 rad/s", gt=0
    )


LAWS = ("wlf", "arrhenius", "shift_factors")


class Material(Parameters):
    """One linear viscoelastic material, with or without a temperature."""

    alternatives: ClassVar[tuple[Alternatives, ...]] = (
        (("kelvin",), ("standard_solid",), ("prony",), ("power_law",), ("dma_table",)),
    )
    kelvin: Kelvin | None = Field(default=None, description="Kelvin body, a spring and a dashpot in parallel")
    standard_solid: StandardSolid | None = Field(
        default=None, description="standard solid, a spring and one Prony term in parallel"
    )
    prony: PronySeries | None = Field(
        default=None, description="Prony series, a spring and any number of Prony terms in parallel"
    )
    power_law: PowerLaw | None = Field(default=None, description="solid whose loss modulus is a power of the frequency")
    dma_table: ModulusTable | None = Field(
        default=None, description="Prony series fitted to a table of measured moduli (dynamic mechanical analysis)"
    )
    temperature: float | None = quantity(
        "K", "temperature of the material; needs wlf, arrhenius or shift_factors", usual="20 degC", default=None, gt=0
    )
    wlf: Wlf | None = Field(
        default=None, description="law of Williams, Landel and Ferry for the relaxation times at other temperatures"
    )
    arrhenius: Arrhenius | None = Field(
        default=None, description="Arrhenius law for the relaxation times at other temperatures"
    )
    shift_factors: ShiftFactors | None = Field(
        default=None, description="measured factors a_T of the relaxation times at other temperatures"
    )

    @property
    def law(self) -> Law | None:
        """The law by which the relaxation times depend on the temperature, or None if no law is given."""
        return self.wlf or self.arrhenius or self.shift_factors

    @model_validator(mode="after")
    def _one_of_each(self, info: ValidationInfo) -> Material:
        self.require_one_alternative()
        laws = [law for law in LAWS if getattr(self, law) is not None]
        if len(laws) > 1:
            raise ValueError(f"expected one of {', '.join(LAWS)}, got {' and '.join(laws)}")
        superposing = self.dma_table is not None and self.dma_table.table_temperature is None
        if (self.temperature is not None and not laws) or (self.temperature is None and laws and not superposing):
            hint = " (`mdr-dask master-curve` computes wlf from a table; or vary the option reference of dma_table)"
            raise ValueError(
                f"expected a temperature together with one of {', '.join(LAWS)}: give both or neither"
                f"{'' if self.dma_table is None or laws else hint}"
            )
        check_in_campaign(info, lambda: solid_of(self))
        return self

    def notes(self) -> tuple[str, ...]:
        """Return notes on the error of a fitted Prony series, on b_T, and on a temperature outside a table."""
        return (*fit_notes(self), *_table_notes(self))


@lru_cache(maxsize=256)
def solid_of(material: Material) -> LinearSolid:
    """Return static modulus, Prony terms and dashpot of the material at its temperature.

    Raise DataError or ValueError if the parameters do not describe a solid, or if a table cannot be fitted.
    """
    from mdr_dask.physics import solids as rheology

    solid, factor = _solid(material), _shift(material)
    if factor is not None:
        solid = rheology.at_temperature(solid, factor)
    rise = _vertical(material)
    return replace(solid, static_modulus=solid.static_modulus / rise, moduli=solid.moduli / rise)


def _shift(material: Material) -> float | None:
    """Return the ratio of the relaxation times at the material's temperature to the relaxation times of the data.

    Return None if the material has no temperature.
    """
    law, temperature = material.law, material.temperature
    if law is None or temperature is None:
        return None
    own = None if material.dma_table is None else one_curve(material.dma_table, law).temperature
    return float(law.factor(temperature)) / (1.0 if own is None else float(law.factor(own)))


def _vertical(material: Material) -> float:
    """Return b_T at the material's temperature. The moduli of a table are divided by this factor.

    Return 1 if the material has no table, or if the temperature of the material or of the table is not given.
    """
    table, temperature = material.dma_table, material.temperature
    if table is None or temperature is None:
        return 1.0
    own = one_curve(table, material.law).temperature
    return 1.0 if own is None else float(vertical_factor(table, np.array([temperature]), own)[0])


def _solid(material: Material) -> LinearSolid:
    from mdr_dask.physics import solids as rheology

    if material.kelvin is not None:
        return rheology.kelvin(material.kelvin.shear_modulus, material.kelvin.relaxation_time)
    if material.standard_solid is not None:
        one = material.standard_solid
        return rheology.standard_solid(one.static_modulus, one.glass_modulus, one.relaxation_time)
    if material.prony is not None:
        series = material.prony
        return rheology.prony(series.static_modulus, series.moduli, series.times, series.viscosity)
    fit = _fit_of(material)
    assert fit is not None
    return fit.solid


def _fit_of(material: Material) -> SeriesFit | None:
    """Return the Prony series fitted to a power law or a table. Return None for other materials."""
    if material.power_law is not None:
        return _power_law_fit(material.power_law)
    return None if material.dma_table is None else _table_fit(material.dma_table, material.law)


@lru_cache(maxsize=64)
def _table_fit(table: ModulusTable, law: Law | None) -> SeriesFit:
    from mdr_dask.physics.solids import fit_series

    moduli = one_curve(table, law)
    return fit_series(moduli.omega, moduli.storage, moduli.loss, table.terms_per_decade)


@lru_cache(maxsize=256)
def _power_law_fit(law: PowerLaw) -> SeriesFit:
    from mdr_dask.physics.solids import power_law_series

    numbers = law.static_modulus, law.loss_modulus, law.frequency, law.exponent, law.lowest, law.highest
    return power_law_series(*numbers)


def fit_error(material: Material | None) -> float:
    """Return the rms relative error of a Prony series that is fitted to a power law or a table.

    Return 0 for other materials.
    """
    fit = None if material is None else _fit_of(material)
    return 0.0 if fit is None else fit.error


def frequencies(material: Material) -> tuple[float, float] | None:
    """Return the lowest and highest angular frequency, in rad/s, of the data of a power law or a table.

    The frequencies are shifted to the material's temperature. Return None for other materials.
    """
    fit = _fit_of(material)
    if fit is None:
        return None
    factor = _shift(material) or 1.0
    return fit.range[0] / factor, fit.range[1] / factor


def fit_notes(material: Material) -> tuple[str, ...]:
    """Return a note with the error of a Prony series that was fitted to a power law or a table."""
    fit = _fit_of(material)
    if fit is None:
        return ()
    what, how = "power law", ""
    if material.dma_table is not None:
        what, how = f"table {material.dma_table.file.name}", one_curve(material.dma_table, material.law).superposed
    lowest, highest = fit.range
    both = (("G'", fit.storage_error), ("G''", fit.loss_error))
    errors = [f"{error:.1%} in {modulus}" for modulus, error in both if np.isfinite(error)]
    return (
        f"{what}: {how and how + '; '}{fit.solid.times.size} Prony terms for {lowest:.3g} to {highest:.3g} rad/s, "
        f"rms error {', '.join(errors)}, largest {fit.largest_error:.1%} at {fit.worst_frequency:.3g} rad/s",
    )


def _table_notes(material: Material) -> tuple[str, ...]:
    """Return notes on a table of moduli: on the use of b_T, and on a temperature outside the table."""
    table, temperature = material.dma_table, material.temperature
    if table is None:
        return ()
    curve, notes = one_curve(table, material.law), []
    if temperature is not None and curve.temperature is not None and table.vertical != "none":
        notes.append(
            f"at temperatures other than {shown(curve.temperature, 'K')}, moduli are divided by "
            "b_T = rho0 T0 / (rho T) (`vertical: none` turns this off)"
        )
    low, high = curve.measured or (0.0, np.inf)
    if temperature is not None and not low - SAME_TEMPERATURE <= temperature <= high + SAME_TEMPERATURE:
        ends = shown(low, "K") if high - low < SAME_TEMPERATURE else f"{shown(low, 'K')} to {shown(high, 'K')}"
        notes.append(
            f"measured at {ends}; outside this range, at {shown(temperature, 'K')}, "
            "moduli are extrapolated by shift factors"
        )
    return tuple(f"table {table.file.name}: {note}" for note in notes)
