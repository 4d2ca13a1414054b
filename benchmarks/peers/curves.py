"""Compare shift factors with those of the programs mastercurves and pyvisco."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from benchmarks.peers import OURS, installed
from benchmarks.rows import Row, timed
from benchmarks.solvers.curves import on_a_shape
from mdr_dask.physics.superposition.master_curve import superpose

SCATTER, FAMILIES = 0.01, 4
CASES = ("sigmoid", "bump", "flat plateau")
DECADE = np.log(10)


def ours(groups, pieces):
    """Return our factors and the half widths of their 95 % intervals; the factor of the first curve is zero."""
    found = superpose(groups, pieces, reference=groups[0])
    low, high = found.interval()[:, : found.groups.size]
    return found.horizontal, (high - low) / 2


def by_gaussian_processes(groups, pieces, noise):
    """Return factors and half widths by mastercurves, used as in its manual: natural logarithms, within two decades."""
    from mastercurves import MasterCurve
    from mastercurves.transforms import Multiply

    merged = MasterCurve(fixed_noise=noise)
    merged.add_data([x * DECADE for x, _ in pieces], [y * DECADE for _, y in pieces], list(groups))
    merged.add_htransform(Multiply(bounds=(1, 1e2)))
    merged.superpose()
    factors = np.array(merged.hparams[0])
    return np.log10(factors), 1.96 * np.array(merged.huncertainties[0]) / factors / DECADE


def by_power_laws(groups, pieces):
    """Return factors by pyvisco, which gives no error."""
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
    except RuntimeError:  # the fit of a power law did not converge
        return unknown, unknown


def ways():
    """Return the methods that are installed."""
    found = {(OURS, ""): ours}
    if name := installed("mastercurves"):
        for setting, noise in (("", 0.04), ("scatter known", SCATTER * DECADE)):
            found[name, setting] = lambda groups, pieces, noise=noise: by_gaussian_processes(groups, pieces, noise)
    if name := installed("pyvisco"):
        found[name, ""] = by_power_laws
    return found


def compared() -> Iterator[Row]:
    """Yield, for each shape and method, median time, error and half width, and the share of factors in the interval."""
    warnings.simplefilter("ignore")  # warnings of Gaussian processes about a bound, and of pandas about attributes
    methods = ways()
    for shape in CASES:
        judged = {name: [] for name in methods}
        for index in range(FAMILIES):
            family = on_a_shape(shape, np.random.default_rng((7, index)), SCATTER)
            for name, method in methods.items():
                with np.errstate(all="ignore"):
                    (factors, half), seconds = timed(method, family.groups, family.curves)
                errors = np.abs(factors - (family.factors - family.factors[0]))[1:]
                judged[name].append((np.full(errors.size, seconds), errors, half[1:]))
        for (name, setting), rows in judged.items():
            seconds, errors, half = np.array(rows).transpose(1, 0, 2)
            known = np.isfinite(errors).all(axis=1)
            if not known.all():
                setting = f"{known.sum()} of {FAMILIES} found"
            error = float(np.median(errors[known])) if known.any() else np.nan
            stated = float(np.median(half))
            inside = float(np.mean(errors <= half)) if np.isfinite(stated) else np.nan
            yield Row("master curves", shape, name, setting, FAMILIES, float(np.median(seconds)), error, stated, inside)
