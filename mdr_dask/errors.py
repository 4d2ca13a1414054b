"""The exceptions of mdr_dask, and hints for messages.

Exceptions take positional arguments only, because workers send them as pickles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

#: `LOOK`: time in s between two checks of what other processes have done, and between two updates of a progress bar.
#: `PAUSE`: time in s of waiting after which a message is printed, and after which a request to another process counts
#: as failed. Both are chosen by trial.
LOOK, PAUSE = 1.0, 5.0
#: Largest number of values that a text lists one by one, and of panels or series in a figure. Chosen by trial.
LISTED = 6


class MdrDaskError(Exception):
    """Base class of the exceptions that mdr_dask defines."""


class CampaignError(MdrDaskError):
    """A campaign that cannot be run. Each argument of the exception is one message."""

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.args)


class ModelError(MdrDaskError):
    """A model that does not exist, cannot be loaded, or has a declaration that cannot be used."""


class StoreError(MdrDaskError):
    """A store that cannot be read, written or extended."""


class StoreBusyError(StoreError):
    """A store that another run is using, or a run that has lost its lock on the store."""


class ClusterError(MdrDaskError):
    """A Dask cluster that cannot be started, does not answer, disappears, or has no workers.

    Also a worker that lacks a module, or has another version of mdr_dask or of the model.
    """


class MachineError(MdrDaskError):
    """A fault of the machine, such as a full disk. It does not count as a failed case: run the campaign again."""


class DataError(MdrDaskError):
    """A table, profile or selection that is invalid or incomplete."""


class CodeError(DataError):
    """A figure or law whose function has raised an unexpected exception."""


class FitError(MdrDaskError):
    """A law that cannot be fitted to the data."""


#: For each common name of a quantity: the parameters and outputs that a user may mean by this name.
_SYNONYMS = {
    "load": ("normal_force", "line_load"),
    "force": ("normal_force", "line_load"),
    "pressure": ("normal_force", "line_load"),
    "speed": ("velocity", "mean_velocity", "rotation_speed"),
    "velocity": ("mean_velocity", "rotation_speed"),
    "rpm": ("rotation_speed",),
    "diameter": ("radius", "roller_radius", "tip_radius"),
    "hv": ("hardness",),
    "mu": ("friction_coefficient", "friction"),
    "friction": ("friction_coefficient",),
    "roughness": ("rms_roughness",),
    "modulus": ("shear_modulus", "contact_modulus"),
    "repeats": ("realisations",),
    "samples": ("realisations",),
    "profile": ("surface",),
    "shape": ("indenter",),
    "alpha": ("pressure_viscosity",),
    "slip": ("slide_roll_ratio",),
}
#: How the suggested quantity differs from the quantity that the user named.
_DIFFERENCES = {"diameter": ", half the diameter", "pressure": ", a load instead of a pressure"}


def did_you_mean(word: Any, known: Sequence[str]) -> str:
    """Return the hint of `similar`. If it is empty, list the known words, unless there are more than 12."""
    return similar(word, known) or (f" (known: {', '.join(known)})" if 0 < len(known) <= 12 else "")


def similar(word: Any, known: Sequence[str]) -> str:
    """Return a hint with one known word, such as `` (did you mean 'hurst'?)``, or an empty text.

    The known word is similar to `word` or contains it, or `word` is a common name for it, such as ``mu`` for
    ``friction``. The last part of `word` may also be such a name, as in ``roller_diameter``.
    """
    from difflib import get_close_matches

    folded = {name.casefold(): name for name in known}
    typed = str(word).casefold()
    quantity = typed.rpartition("_")[2]  # diameter in roller_diameter
    synonyms = [name for name in _SYNONYMS.get(quantity, ()) if name in folded]
    alike = get_close_matches(typed, list(folded), n=1)
    if synonyms and quantity in _DIFFERENCES:
        return f" (did you mean {folded[synonyms[0]]!r}{_DIFFERENCES[quantity]}?)"
    near = (synonyms if quantity == typed and synonyms else alike or synonyms) or [
        name for name in folded if len(typed) > 2 and typed in name
    ]
    return f" (did you mean {folded[near[0]]!r}?)" if near else ""


def with_digits(number: float, digits: int) -> str:
    """Return a number rounded to `digits` significant digits (at most 10), without trailing zeros.

    The text has an exponent only if the absolute value is at least 1e10, or below 1e-4 but not zero.
    """
    return f"{float(f'{number:.{digits}g}'):.10g}"
