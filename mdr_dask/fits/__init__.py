"""Fit laws to the results in a store, with intervals of the constants and the goodness of fit."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points

from mdr_dask.fits.base import Fit

#: The modules that have a tuple ``FITS``, and the models to whose stores the fits of each module apply. An empty tuple
#: means all models.
SUBJECTS: dict[str, tuple[str, ...]] = {
    "calibration": (),
    "ehl": ("ehl_line",),
    "friction": ("sliding_friction",),
    "indenter": ("sliding_friction",),
    "jumps": ("velocity_jump",),
    "master_curve": ("sliding_friction",),
    "relaxation": ("velocity_jump",),
    "scaling": ("sliding_friction",),
}

#: Name of the group of entry points through which other packages offer tuples of `Fit`.
GROUP = "mdr_dask.fits"


def available(model: str) -> dict[str, Fit]:
    """Return the fits for stores of a model, indexed by name, including fits that other packages offer in `GROUP`."""
    subjects = [subject for subject, models in SUBJECTS.items() if model in models or not models]
    own = (import_module(f"mdr_dask.fits.{subject}").FITS for subject in subjects)
    others = (entry.load() for entry in entry_points(group=GROUP))
    return {fit.name: fit for fits in (*own, *others) for fit in fits if model in fit.models or not fit.models}
