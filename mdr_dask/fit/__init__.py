"""Laws fitted to a store, with intervals and goodness of fit."""

from __future__ import annotations

from importlib import import_module

from mdr_dask.fit.base import Fit

#: Modules of this room that hold ``FITS``.
SUBJECTS: tuple[str, ...] = ("ehl", "friction", "kinetics", "master_curve", "mixed", "wear")


def available(model: str) -> dict[str, Fit]:
    """Return the fits that understand the stores of a model, by name."""
    fits = (fit for subject in SUBJECTS for fit in import_module(f"mdr_dask.fit.{subject}").FITS)
    return {fit.name: fit for fit in fits if model in fit.models}
