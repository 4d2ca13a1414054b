"""Master curves on record: factors, covariances, scans, curves, draws, laws, and what is refused."""

import numpy as np
import pytest
import record
from flattened import flat

from mdr_dask.errors import MdrDaskError
from mdr_dask.physics.superposition import factors, least_squares, problem, steps
from mdr_dask.physics.superposition.laws import fit_arrhenius, fit_power, fit_wlf
from mdr_dask.physics.superposition.master_curve import rereference, superpose
from mdr_dask.physics.superposition.two_factors import superpose_twice

SHIFTS = np.array([0.0, 0.34, 0.81, 1.02, 1.55])
RISES = 0.07 * np.array([0.0, 1.0, 1.7, 3.1, 4.2])
SHAPES = {
    "sigmoid": lambda x: 1.7 * np.tanh(0.6 * x - 0.4),
    "plateau": lambda x: -0.3 * np.logaddexp(0, 4 - 4 * x),
    "bump": lambda x: np.exp(-0.5 * (x - 1) ** 2),
}


def family(shape, rise=0.0, scatter=0.01):
    """Five curves of unequal numbers of points, whose scatter is no chance."""
    found = []
    for k, shift in enumerate(SHIFTS):
        x = np.linspace(-1.0 + 0.05 * k, 1.1, 13 + 2 * k)
        wiggle = np.sin(37.0 * x + 11 * k) + np.cos(91.0 * x + 5 * k)
        found.append((x, SHAPES[shape](x + shift) - rise * RISES[k] + scatter * wiggle))
    return found


def why(function, *arguments, **named):
    """The sentence with which something is refused."""
    try:
        function(*arguments, **named)
    except MdrDaskError as error:
        return str(error)
    return "taken"


@pytest.mark.parametrize("shape", SHAPES)
def test_master_curves(shape, dataframe_regression):
    groups, found = [11.0, 20.0, 31.0, 45.0, 60.0], {}
    for vertical in (False, True):
        curve = superpose(groups, family(shape, float(vertical)), vertical, draws=3, seed=4)
        found |= {f"{vertical}": curve, f"{vertical} errors": (curve.horizontal_error, curve.vertical_error)}
        found |= {f"{vertical} moved": curve.moved(0.3).measured}
        for logarithmic in (False, True):
            again = rereference(curve, 25.0, logarithmic)
            part = again.horizontal, again.vertical, again.covariance, again.curve_error, again.measured, again.draws
            found |= {f"{vertical} at 25 {logarithmic}": [*part, again.curve_cross, again.curve_y, again.x]}
    record.check(dataframe_regression, flat("", found))


def test_two_shifts(dataframe_regression):
    """A sum that holds and one that does not, all pairs and some, with draws and vertical factors."""
    velocity, temperature, curves, summed = [], [], [], []
    for i, j in ((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (1, 2), (2, 2)):
        x = np.linspace(-1, 1.2, 15 + i)
        y = SHAPES["sigmoid"](x + 0.4 * i + 0.55 * j + 0.06 * i * j) + 0.004 * np.sin(41 * x + 3 * i + j)
        velocity.append([0.1, 1.0, 10.0][i])
        temperature.append([293.0, 310.0, 333.0][j])
        curves.append((x, y - 0.03 * i))
        wiggle = np.sin(37 * x + 11 * i + 3 * j) + np.cos(91 * x + 5 * i - j)
        summed.append((x, SHAPES["sigmoid"](x + 0.4 * i + 0.55 * j) + 0.05 * wiggle))
    found = {"plain": superpose_twice(velocity, temperature, curves)}
    found |= {"vertical": superpose_twice(velocity, temperature, curves, (10.0, 300.0), 2, 1, True)}
    found |= {
        "sum": superpose_twice(velocity, temperature, summed),
        "few": superpose_twice([1, 1, 2], [3, 4, 3], summed[:3]),
    }
    found |= {"parts": why(superpose_twice, [1, 2, 3, 4], [1, 1, 2, 2], curves[:4])}
    found |= {"one": why(superpose_twice, [1, 1, 1], [1, 2, 3], curves[:3])}
    record.check(dataframe_regression, flat("", found))


def test_scans_and_fits(dataframe_regression):
    found = {}
    for shape in ("sigmoid", "plateau"):
        one, origin = problem.ShiftProblem.of(family(shape, 1.0)).from_own_origin()
        guess = one.first_guess()
        found |= {f"{shape} problem": (origin, one.width, one.height, one.grid, one.windows, guess)}
        common = problem.Common(0.4, 0.21)
        found |= {f"{shape} prior": one.prior(common), f"{shape} priors": one.priors(0.4)[3]}
        found |= {f"{shape} rises": one.rises(0.3, 4), f"{shape} guess": one.lifted(RISES).first_guess()}
        shifts = least_squares.Shifts(np.append(0.0, np.cumsum(guess)), np.zeros(5))
        fitted = least_squares.fit(one.points, shifts, one.grid, one.prior(common), (1e-3, 0.0), 7)
        found |= {f"{shape} fit": fitted}
        kept = least_squares.fit(one.points, fitted[0], one.grid, one.priors(0.4)[5], (0.02, 1e-4), 5)
        found |= {f"{shape} both": kept}
        for name, priors in (("level", [one.prior(common)]), ("both", one.priors(0.4))):
            found |= {
                f"{shape} {name} changes": least_squares.changes_of(one.points, kept[0], one.grid, 0.02, 1e-4, priors)
            }
        for rising in (0.0, 0.2):
            pairs = steps.scan_pairs(one, 0.02, 1e-4, rising)
            spread = 1e-3 * (np.eye(4) + 0.2)
            scanned = steps.scan(one, kept[0], spread, (0.02, 1e-4), common, pairs, rising)
            found |= {f"{shape} {rising} places": np.concatenate(scanned.places)}
            logs = [np.concatenate([log - log.max() for log in logs]) for logs in (pairs.logs, scanned.logs)]
            found |= {f"{shape} {rising} logs": np.arctan(logs[1]), f"{shape} {rising} pairs": np.arctan(logs[0])}
            found |= {f"{shape} {rising} steps": steps.together(scanned, one)}
        found |= {f"{shape} overlapping": np.array([steps._overlapping(one, 0.3 * SHIFTS, k) for k in range(4)])}
        found |= {f"{shape} apart": np.array([steps._overlapping(one, 2.5 * SHIFTS, k) for k in range(4)])}
        for name, end in (("level", factors.find_horizontal(one)), ("both", factors.find_both(one))):
            kept_parts = {part: value for part, value in end._asdict().items() if part != "prior"}
            found |= {f"{shape} found {name}": kept_parts, f"{shape} {name} prior": end.prior.mean}
    record.check(dataframe_regression, flat("", found))


def test_laws(dataframe_regression):
    groups = np.array([273.0, 290.0, 301.0, 318.0, 340.0, 361.0])
    scatter = np.array([0.3, -0.2, 0.0, 0.5, -0.6, 0.2])
    covariance = np.diag([4.0, 1.0, 0.0, 2.0, 3.0, 5.0]) * 1e-4 + 1e-5 * np.outer(scatter, scatter)
    covariance[2] = covariance[:, 2] = 0.0
    found = {}
    for size in (0.0, 0.02, 0.4):
        wlf = -8.1 * (groups - 301) / (71 + groups - 301) + size * scatter
        straight = 0.04 * (groups - 301) + size * scatter
        arrhenius = 4e3 * (1 / groups - 1 / 301.0) + size * scatter
        found |= {f"wlf {size}": fit_wlf(groups, wlf, covariance, 301.0)}
        found |= {f"straight {size}": fit_wlf(groups, straight, covariance, 301.0)}
        found |= {f"falling {size}": fit_wlf(groups, -straight, covariance, 301.0)}
        found |= {f"arrhenius {size}": fit_arrhenius(groups, arrhenius, covariance, 301.0)}
        found |= {f"power {size}": fit_power(groups, 0.7 * np.log10(groups / 301) + size * scatter, covariance, 301.0)}
    found |= {"refused": [why(law, groups - 300, wlf, covariance, 1.0) for law in (fit_power, fit_arrhenius)]}
    found |= {"few": [why(law, groups[1:3], wlf[1:3], covariance[1:3, 1:3], 301.0) for law in (fit_power, fit_wlf)]}
    record.check(dataframe_regression, flat("", found))


def test_what_is_refused(dataframe_regression):
    curves = family("sigmoid")
    far = [(x + 30.0 * k, y) for k, (x, y) in enumerate(curves)]
    flat_one = [(x, 0.0 * y) for x, y in curves]
    bad = [(np.array([1.0, 1.0]), np.array([0.0, 1.0])), *curves[1:]]
    gone = [(np.array([1.0, np.nan]), np.array([0.0, 1.0])), *curves[1:]]
    groups = [1.0, 2.0, 3.0, 4.0, 5.0]
    found = {name: why(superpose, groups, some) for name, some in (("flat", flat_one), ("bad", bad), ("gone", gone))}
    found |= {"groups": [why(superpose, some, curves[:2]) for some in ([1.0, 1.0], [1.0], [1.0, 2.0, 3.0])]}
    found |= {"reference": why(superpose, groups, curves, reference=7.0), "one": why(superpose, [1.0], curves[:1])}
    found |= {"far": superpose(groups, far).horizontal}
    record.check(dataframe_regression, flat("", found))
