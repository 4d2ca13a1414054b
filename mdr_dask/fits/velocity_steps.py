"""Rate-and-state constants from a measured velocity-step test: friction while the velocity changes in steps."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.optimize import brentq
from scipy.special import stdtr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, FitError, distinguishable
from mdr_dask.fits.calibration import read_file
from mdr_dask.fits.determined import ENDS, SHARES, quantiles
from mdr_dask.fits.misfit import Residuals, law_holds
from mdr_dask.tables import Column, read_table

COLUMNS = (
    Column("time", "s"),
    Column("velocity", "m/s", above=0.0),
    Column("friction_coefficient", "1", ("friction", "mu")),
)
#: Fewest rows.
FEWEST = 8
#: Slip lengths that are tried, first from a part of the least step of slip to several times the whole, then where they
#: are likely.
TRIED = 400
SHORTEST, LONGEST = 0.3, 3.0
#: Share of the highest density at the ends of what is tried, above which the slip length is not determined.
OPEN = 0.02
LAW = "mu = mu_1 + a ln(v / v_1) + b x,  dx/ds = -(x + ln(v / v_1)) / D_c"
MEANINGS = {
    "direct_effect": ("1", "a, change of friction at once for a factor e of velocity"),
    "evolution_effect": ("1", "b, what of it goes back"),
    "velocity_dependence": ("1", "a - b, change of steady friction for a factor e of velocity"),
    "friction_before": ("1", "steady friction before the first step"),
    "slip_length": ("m", "D_c, slip in which the change goes back by a factor e"),
}


class Trace(NamedTuple):
    """A velocity-step test.

    Attributes
    ----------
    time, velocity, friction : array, shape (rows,)
        In SI. The velocity of a row holds since the row before.
    """

    time: FloatArray
    velocity: FloatArray
    friction: FloatArray

    @property
    def slip(self) -> FloatArray:
        """Slip since the row before, shape (rows,)."""
        return np.diff(self.time, prepend=self.time[0]) * self.velocity

    @property
    def logarithm(self) -> FloatArray:
        """ln(v / v_1), shape (rows,)."""
        return np.asarray(np.log(self.velocity / self.velocity[0]))

    def state(self, lengths: FloatArray) -> FloatArray:
        """Return the state x for every slip length, shape (lengths, rows); steady in the first row."""
        steady, kept = -self.logarithm, np.exp(-self.slip / lengths[:, None])
        states = np.zeros_like(kept)
        for row in range(1, self.time.size):
            states[:, row] = steady[row] + (states[:, row - 1] - steady[row]) * kept[:, row]
        return states

    @property
    def since_step(self) -> FloatArray:
        """Slip since the last step of the velocity, shape (rows,)."""
        total = np.cumsum(self.slip)
        steps = np.flatnonzero(np.diff(self.velocity)) + 1
        before = np.concatenate([[0.0], total[steps - 1]])
        since: FloatArray = total - before[np.searchsorted(steps, np.arange(total.size), side="right")]
        return since


def read_trace(text: str, source: str) -> Trace:
    """Read a velocity-step test.

    Raises
    ------
    DataError
        If a column is missing, time does not go on, or the velocity never changes.
    """
    read = read_table(text, source, COLUMNS)
    trace = Trace(*(read[column.name] for column in COLUMNS))
    if trace.time.size < FEWEST:
        raise DataError(f"{source}: expected at least {FEWEST} rows, got {trace.time.size}")
    if np.any(np.diff(trace.time) <= 0):
        row = int(np.flatnonzero(np.diff(trace.time) <= 0)[0])
        later, sooner = distinguishable(trace.time[row + 1], trace.time[row], digits=6)
        raise DataError(f"{source}: expected a time that goes on, got {later} s behind {sooner} s")
    if np.ptp(trace.velocity) == 0:
        raise DataError(
            f"{source}: expected a velocity that changes in steps, got {trace.velocity[0]:g} m/s throughout"
        )
    return trace


class _Linear(NamedTuple):
    """Friction before, a and b for every slip length, and what they leave.

    Attributes
    ----------
    constants : array, shape (lengths, 3)
    spreads : array, shape (lengths, 3, 3)
        Inverses of the normal matrices.
    squares : array, shape (lengths,)
        Sums of squares that are left.
    """

    constants: FloatArray
    spreads: FloatArray
    squares: FloatArray

    def density(self, number: float) -> FloatArray:
        """Return the logarithmic density of the slip lengths for so many independent rows, highest 0."""
        squares = np.maximum(self.squares, 1e-30)
        density = 0.5 * np.linalg.slogdet(self.spreads)[1] - (number - 3) / 2 * np.log(squares)
        found: FloatArray = density - density.max()
        return found


def _fitted(trace: Trace, lengths: FloatArray) -> _Linear:
    state = trace.state(lengths)
    columns = np.stack([np.ones_like(state), np.broadcast_to(trace.logarithm, state.shape), state], axis=-1)
    normal = np.swapaxes(columns, -1, -2) @ columns
    spreads: FloatArray = np.linalg.pinv(normal, hermitian=True).astype(np.float64)
    constants = (spreads @ (np.swapaxes(columns, -1, -2) @ trace.friction[:, None]))[..., 0]
    left = trace.friction - (columns @ constants[..., None])[..., 0]
    return _Linear(constants, spreads, (left**2).sum(axis=-1))


def rate_and_state(trace: Trace) -> xr.Dataset:
    """Fit the slip law of rate-and-state friction to a velocity-step test.

    Parameters
    ----------
    trace : Trace
        Steady before the first step; the machine is held to be stiff.

    Returns
    -------
    Dataset
        a, b, a - b, D_c and friction before, with 68 and 95 % intervals; ends are NaN where D_c is not determined.

    Notes
    -----
    The constants but D_c are linear: for each D_c their posterior is Student's t with the scatter of the residuals.
    D_c is evenly likely in its logarithm beforehand. Residuals that go along with their neighbours count for fewer.

    References
    ----------
    Ruina, J. Geophys. Res. 88, 10359 (1983), doi:10.1029/JB088iB12p10359.
    """
    moved = trace.slip[1:]
    lengths = np.geomspace(SHORTEST * moved.min(), LONGEST * trace.slip.sum(), TRIED)
    number = float(trace.time.size)
    for _ in range(3):
        fit = _fitted(trace, lengths)
        number = _independent(trace, fit, lengths)
        likely = lengths[fit.density(number) > -16]
        ends = likely[0] / 1.05, likely[-1] * 1.05
        lengths = np.geomspace(*ends, TRIED)
    fit = _fitted(trace, lengths)
    density = fit.density(number)
    is_open = bool(np.exp(density[[0, -1]]).max() > OPEN)
    weights = np.exp(density) / np.exp(density).sum()
    samples = {
        "direct_effect": np.array([0.0, 1.0, 0.0]),
        "evolution_effect": np.array([0.0, 0.0, 1.0]),
        "velocity_dependence": np.array([0.0, 1.0, -1.0]),
        "friction_before": np.array([1.0, 0.0, 0.0]),
    }
    found = {name: _interval(fit, weights, parts, number) for name, parts in samples.items()}
    found["slip_length"] = np.exp(quantiles(np.log(lengths), weights, SHARES))
    return _dataset(trace, found, _left(trace, fit, lengths), is_open)


def _independent(trace: Trace, fit: _Linear, lengths: FloatArray) -> float:
    """Return how many rows there are that know nothing of each other, from how residuals go along with the next."""
    left = _left(trace, fit, lengths)
    along = float(left[1:] @ left[:-1]) / max(float(left @ left), 1e-300)
    number = left.size
    return number * (1 - along) / (1 + along) if along > 2 / np.sqrt(number) else float(number)


def _left(trace: Trace, fit: _Linear, lengths: FloatArray) -> FloatArray:
    best = int(np.argmin(fit.squares))
    mu, direct, evolution = fit.constants[best]
    state = trace.state(lengths[best : best + 1])[0]
    left: FloatArray = trace.friction - mu - direct * trace.logarithm - evolution * state
    return left


def _interval(fit: _Linear, weights: FloatArray, parts: FloatArray, number: float) -> FloatArray:
    """Return median and ends of intervals of a linear combination, from Student's t for each slip length."""
    freedom = float(np.maximum(number - 3, 1.0))
    middle = fit.constants @ parts
    scatter = fit.squares / freedom
    width = np.sqrt(np.maximum(scatter * np.einsum("i,kij,j->k", parts, fit.spreads, parts), 1e-30))
    kept = weights > 1e-12
    middle, width, share = middle[kept], width[kept], weights[kept]

    def below(value: float, wanted: float) -> float:
        return float(share @ stdtr(freedom, (value - middle) / width)) - wanted

    low, high = float(middle.min() - 60 * width.max()), float(middle.max() + 60 * width.max())
    return np.array([brentq(below, low, high, args=(wanted,)) for wanted in SHARES])


def _dataset(trace: Trace, found: Mapping[str, FloatArray], left: FloatArray, is_open: bool) -> xr.Dataset:
    """Return constants and intervals; none of what evolves where the slip length is not determined."""
    variables: dict[str, tuple[tuple[()], float | str, dict[str, str]]] = {}
    for name, (unit, meaning) in MEANINGS.items():
        numbers = np.full(len(ENDS), np.nan) if is_open and name != "friction_before" else found[name]
        attributes = {"units": unit, "long_name": meaning}
        variables |= {name + end: ((), float(one), attributes) for end, one in zip(ENDS, numbers, strict=True)}
    scatter = float(np.sqrt(np.mean(left**2)))
    relative = scatter / float(np.ptp(trace.friction))
    residuals = Residuals(left / max(scatter, 1e-300), relative, np.nan, left.size - 4)
    verdict = law_holds(residuals, {"slip since the step": trace.since_step}, "the change of friction")
    if is_open:
        verdict = "not tested: the slip length lies below the slip between two rows, or beyond the whole trace"
    variables["scatter"] = ((), scatter, {"units": "1", "long_name": "standard deviation of the residuals"})
    variables["law_holds"] = ((), verdict, {"units": "1"})
    return xr.Dataset(variables, attrs={"law": LAW})


def of_table(text: str, source: str) -> xr.Dataset:
    """Return the rate-and-state constants of a table with the columns time, velocity and friction_coefficient."""
    return rate_and_state(read_trace(text, source))


def of_file(path: str | Path, law: str = "rate_and_state") -> xr.Dataset:
    """Return the constants of the table in a file; all laws but this one are those of stores."""
    if law != "rate_and_state":
        raise FitError(f"{path}: a file, expected the folder of a store for {law!r}; of a table it is rate_and_state")
    found = read_file(path)
    return of_table(found["text"], found["name"])
