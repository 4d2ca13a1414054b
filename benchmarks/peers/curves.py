"""Shift factors beside mastercurves and pyvisco: ``python -m benchmarks peers curves [FAMILIES]``."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator

import numpy as np
from scipy.stats import t as student

from benchmarks.accuracy.points import Point
from benchmarks.measures import timed
from benchmarks.peers.beside import OURS, called, single_threaded
from benchmarks.peers.page import tell
from benchmarks.superposition.accuracy import SHAPES, family
from mdr_dask.physics.superposition.master_curve import superpose

FIRST_SEED, SCATTER = 700_000, 0.01
DECADE = np.log(10)


def ours(groups, pieces):
    """Return factors and half widths of 95 %, the first curve's factor being zero."""
    found = superpose(groups, pieces, reference=groups[0])
    return found.horizontal, student.ppf(0.975, found.freedom) * found.horizontal_error


def by_gaussian_processes(groups, pieces, noise):
    """Return the same by mastercurves, in natural logarithms and within two decades, as its manual has it."""
    from mastercurves import MasterCurve
    from mastercurves.transforms import Multiply

    merged = MasterCurve(fixed_noise=noise)
    merged.add_data([x * DECADE for x, _ in pieces], [y * DECADE for _, y in pieces], list(groups))
    merged.add_htransform(Multiply(bounds=(1, 1e2)))
    merged.superpose()
    factors = np.array(merged.hparams[0])
    return np.log10(factors), 1.96 * np.array(merged.huncertainties[0]) / factors / DECADE


def by_power_laws(groups, pieces):
    """Return factors by pyvisco, which states no error."""
    import pandas as pd
    from pyvisco import master

    curves = [
        pd.DataFrame({"f_set": 10**x, "E_stor": 10**y, "Set": number, "T_round": groups[number]})
        for number, (x, y) in enumerate(pieces)
    ]
    table = pd.concat(curves, ignore_index=True)
    table.modul, table.domain = "E", "freq"
    unknown = np.full(len(pieces), np.nan)
    try:
        return master.get_aT(table, groups[0])[0]["log_aT"].to_numpy(), unknown
    except RuntimeError:  # a fit of a power law did not converge
        return unknown, unknown


def ways():
    """Return the methods that are installed."""
    found = {(OURS, ""): ours}
    if name := called("mastercurves"):
        for setting, noise in (("", 0.04), ("scatter known", SCATTER * DECADE)):
            found[name, setting] = lambda groups, pieces, noise=noise: by_gaussian_processes(groups, pieces, noise)
    if name := called("pyvisco"):
        found[name, ""] = by_power_laws
    return found


def compared(families: int = 4, shapes: tuple[str, ...] = tuple(SHAPES)) -> Iterator[Point]:
    """Yield median time, error and half width of each method, and the share of factors inside, for each shape."""
    methods = ways()
    for method in methods.values():
        method(*family(FIRST_SEED - 1, SCATTER, "sigmoid", False)[:2])  # compiles
    for shape in shapes:
        judged = {name: [] for name in methods}
        for seed in range(FIRST_SEED, FIRST_SEED + families):
            groups, pieces, shifts, _ = family(seed, SCATTER, shape, False)
            for name, method in methods.items():
                with np.errstate(all="ignore"):
                    (factors, half), seconds = timed(method, groups, pieces)
                errors = np.abs(factors - (shifts - shifts[0]))[1:]
                judged[name].append((np.full(errors.size, seconds), errors, half[1:]))
        for (name, setting), rows in judged.items():
            seconds, errors, half = np.array(rows).transpose(1, 0, 2)
            known = np.isfinite(errors).all(axis=1)
            if not known.all():
                setting = f"{known.sum()} of {families} found"
            stated = np.median(half)
            inside = np.mean(errors <= half) if np.isfinite(stated) else np.nan
            middle = np.median(seconds), np.median(errors[known]) if known.any() else np.nan
            yield Point("master curves", shape, name, setting, *middle, stated, inside)


if __name__ == "__main__":
    single_threaded()
    warnings.simplefilter("ignore")  # of Gaussian processes that end at a bound, and of pandas about attributes
    tell(compared(*map(int, sys.argv[1:])))
