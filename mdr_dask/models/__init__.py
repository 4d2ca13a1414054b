"""Access to the models by name. A model is imported when `load` is first called with its name.

Models come from this package, from the entry points of other packages, or from a module of the user.
"""

from __future__ import annotations

import hashlib
import inspect
import logging
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from mdr_dask.errors import ModelError
from mdr_dask.models.base import Model
from mdr_dask.models.per_case import reason

log = logging.getLogger("mdr_dask.models")

NAMES: tuple[str, ...] = (
    "sliding_friction",
    "velocity_jump",
    "fretting_wear",
    "ehl_line",
    "mixed_lubrication",
)

#: Entry point group for models of other packages.
GROUP = "mdr_dask.models"


def names() -> tuple[str, ...]:
    """Return the names of all installed models. The names of this package's models come first."""
    return (*NAMES, *(name for name in _installed() if name not in NAMES))


def load(name: str) -> Model[Any]:
    """Return the model called `name`.

    `name` is one of `names()`, or has the form ``package.module:NAME``. Raise ModelError if no model has this name,
    or if a model from outside this package cannot be imported or is not a `Model`.
    """
    if name in NAMES:
        model: Model[Any] = import_module(f"mdr_dask.models.{name}").MODEL
        return model
    module, colon, _ = name.partition(":")
    if colon:
        return _own(name, EntryPoint(name, name, GROUP), module)
    if name in _installed():
        return _own(name, _installed()[name], _installed()[name].module)
    raise ModelError(f"unknown model {name!r}")


def is_own(name: str) -> bool:
    """Return whether a model comes from outside this package."""
    return name not in NAMES


def source_digest(name: str) -> str | None:
    """Return a digest of the source file of a model from outside this package.

    The source file is the one that defines the function `compute`. Blank lines, comment lines and indentation do not
    change the digest. Return None for a model of this package, or if the source file cannot be read.
    """
    return _digest(load(name).compute) if is_own(name) else None


def require_current(name: str) -> None:
    """Raise ModelError if the digest of a model's source file has changed since this process imported the model."""
    if imported_digest(name) != source_digest(name):
        module = name.partition(":")[0]
        raise ModelError(
            f"the file of the model {name} has changed since this Python session imported it: restart Python, or call "
            f"importlib.reload({module})"
        )


def _digest(compute: Callable[..., Any]) -> str | None:
    try:
        file = inspect.getsourcefile(inspect.unwrap(compute))
        lines = map(str.strip, Path(file or "").read_text().splitlines())
    except (OSError, TypeError, ValueError):
        return None
    code = "\n".join(line for line in lines if line and not line.startswith("#"))
    return hashlib.blake2b(code.encode(), digest_size=8).hexdigest()


#: `_own` makes the first call, when a model is imported. Later calls return the cached digest.
_digest_at_import = lru_cache(_digest)


def imported_digest(name: str) -> str | None:
    """Return the `source_digest` of a model at the time when this process imported the model."""
    return _digest_at_import(load(name).compute) if is_own(name) else None


def registered_name(name: str) -> str:
    """Return the name under which a package registers the model at ``package.module:NAME``.

    Return `name` unchanged if no package registers it.
    """
    return next((known for known, entry in _installed().items() if entry.value == name), name)


def offered(entries: Iterable[EntryPoint]) -> Iterator[Any]:
    """Yield the fits or figures that other packages offer. If an entry cannot be loaded, log a warning and skip it."""
    for entry in entries:
        try:
            yield from entry.load()
        except Exception as error:
            _warn_of_broken_module(entry.group, entry.value, reason(error))


@lru_cache
def _warn_of_broken_module(group: str, value: str, why: str) -> None:
    log.warning("%s are left out: cannot load %s: %s", group.replace(".", " "), value, why)


@lru_cache(maxsize=1)
def _installed() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def _own(name: str, entry: EntryPoint, module: str) -> Model[Any]:
    """Import a model from outside this package. Every error of the import becomes a ModelError.

    The functions of the model, except `compute`, are wrapped by `_guarded`.
    """
    try:
        found = entry.load()
    except ModuleNotFoundError as error:
        hint = "install its package, or put its folder on PYTHONPATH" if module.startswith(str(error.name)) else error
        raise ModelError(f"cannot import {module!r} for model {name!r}: {hint}") from None
    except AttributeError as error:
        raise ModelError(f"cannot load model {name!r}: {error} (expected module:NAME of a Model)") from None
    except Exception as error:
        raise ModelError(f"cannot load model {name!r}: {type(error).__name__}: {error}") from None
    if not isinstance(found, Model):
        raise ModelError(f"expected {name!r} to be an mdr_dask.models.base.Model, got {type(found).__name__}")
    _digest_at_import(found.compute)
    others = ("operations", "coordinates", "units", "notes")
    guarded: dict[str, Any] = {
        each: _guarded(name, each, getattr(found, each)) for each in others if getattr(found, each) is not None
    }
    return replace(found, **guarded)


def _guarded(model: str, what: str, function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Return a function that calls `function` of a model from outside this package. Exceptions become ModelErrors.

    ModelError is also raised if the function `operations` returns a number that is negative or not finite.
    """

    def call(argument: Any) -> Any:
        try:
            found = function(argument)
            if what == "operations" and not 0 <= float(found) < math.inf:
                raise ValueError(f"expected a finite number that is not negative, got {found!r}")
        except Exception as error:
            raise ModelError(f"the function {what!r} of model {model!r} failed: {reason(error)}") from None
        return found

    return call
