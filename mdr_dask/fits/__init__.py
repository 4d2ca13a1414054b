"""Fit laws to the results in a store, with intervals of the constants and the goodness of fit."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points
from itertools import chain

from mdr_dask import models
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
    subjects = [subject for subject, about in SUBJECTS.items() if model in about or not about]
    own = (import_module(f"mdr_dask.fits.{subject}").FITS for subject in subjects)
    every = chain(*own, models.offered(entry_points(group=GROUP)))
    name = models.registered_name(model)
    return {fit.name: fit for fit in every if name in fit.models or not fit.models}
