"""Laws fitted to a store, with intervals and goodness of fit."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points

from mdr_dask.fits.base import Fit

#: Modules of this package with a tuple ``FITS``.
SUBJECTS: tuple[str, ...] = (
    "calibration",
    "ehl",
    "friction",
    "indenter",
    "jumps",
    "master_curve",
    "relaxation",
    "scaling",
)

#: Entry point group in which other packages offer tuples of `Fit`.
GROUP = "mdr_dask.fits"


def available(model: str) -> dict[str, Fit]:
    """Return the fits for stores of a model, by name; other packages offer tuples of them in `GROUP`."""
    own = (import_module(f"mdr_dask.fits.{subject}").FITS for subject in SUBJECTS)
    others = (entry.load() for entry in entry_points(group=GROUP))
    return {fit.name: fit for fits in (*own, *others) for fit in fits if model in fit.models or not fit.models}
