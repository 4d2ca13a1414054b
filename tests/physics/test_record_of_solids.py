"""Linear solids on record: moduli, series fitted to laws and tables, shift factors, free recovery."""

import numpy as np
import record
from flattened import flat

from mdr_dask.physics import solids
from mdr_dask.physics.linear import factorise
from mdr_dask.physics.outcome import Outcome

OMEGA = np.geomspace(0.3, 7e3, 13)


def why(function, *arguments):
    """The sentence with which something is refused."""
    try:
        function(*arguments)
    except ValueError as error:
        return str(error)
    return "taken"


def test_solids(dataframe_regression):
    solid = solids.prony(1.3e6, [2e6, 5e5, 7e6], [0.3, 2e-3, 4e-5], 12.0)
    other = solids.prony(0.9e6, [3e6], [1e-2])
    modulus = solids.complex_modulus(solid, OMEGA)
    found = {"solid": solid, "storage": modulus.real, "loss": modulus.imag}
    found |= {"relaxation": solids.relaxation_modulus(solid, [1e-6, 1e-3, 0.4, 9.0])}
    found |= {f"law {arms}": solids.power_law_series(1e6, 3e5, 20.0, 0.37, 0.1, 4e3, arms) for arms in (1, 2, 3)}
    wanted = solids.complex_modulus(other, OMEGA) * (1 + 0.03 * np.sin(np.arange(13)))
    for arms, dashpot in ((1.0, False), (1.7, False), (0.6, True)):
        fit = solids.fit_series(OMEGA[::-1], wanted.real[::-1], wanted.imag[::-1], arms, dashpot)
        found |= {f"fit {arms} {dashpot}": fit, f"fit {arms} {dashpot} error": fit.error}
    T = np.array([281.0, 293.0, 340.0])
    found |= {"wlf": solids.wlf_factor(T, 293.0, 8.9, 101.0), "arrhenius": solids.arrhenius_factor(T, 293.0, 8.3e4)}
    found |= {"warm": solids.at_temperature(solid, 0.37), "gas": solids.GAS_CONSTANT}
    for name, moduli in (("even", [0.3, 2.0, 5.0, 0.01]), ("steep", [1e-6, 40.0, 1e3, 3e5])):
        found |= {f"recovery {name}": solids.recovery(np.array(moduli), np.array([0.01, 0.02, 3.0, 3.001]))}
    found |= {"dashpot": solids.recovery_times(np.array([0.4, 0.2, 9.0]), np.array([0.0, 0.3, 2.0]))}
    rising = OMEGA**2
    refused = (
        (solids.power_law_series, 1e6, 3e5, 20.0, 1.0, 0.1, 4e3),
        (solids.power_law_series, 1e6, 3e5, 20.0, 0.0, 0.1, 4e3),
        (solids.power_law_series, 1e6, 3e5, 20.0, 0.4, 5.0, 5.0),
        (solids.fit_series, OMEGA[:3], OMEGA[:3], OMEGA[:2]),
        (solids.fit_series, OMEGA[:1], OMEGA[:1], OMEGA[:1]),
        (solids.fit_series, OMEGA, rising, 0.0 * rising),
        (solids.fit_series, OMEGA, rising, rising),
        (solids.wlf_factor, 190.0, 293.0, 8.9, 103.0),
        (solids.arrhenius_factor, 0.0, 293.0, 1e4),
        (solids.arrhenius_factor, 293.0, 0.0, 1e4),
        (solids.prony, 1e6, [1.0, 2.0], [1.0]),
        (solids.prony, 0.0, [1.0], [1.0]),
        (solids.prony, 1e6, [1.0, 2.0], [1.0, 1.0]),
        (solids.prony, 1e6, [-1.0], [1.0]),
        (solids.prony, 1e6, [1.0], [0.0]),
        (solids.prony, 1e6, [1.0], [1.0], -1.0),
    )
    found |= {"refused": [why(*each) for each in refused]}
    record.check(dataframe_regression, flat("", found))


def test_equations_and_outcomes(dataframe_regression):
    matrix = np.array([[0.0, 2.0, 1.0], [3.0, -1.0, 0.5], [1.0, 1.0, 7.0]])
    found = {"solution": factorise(matrix.copy()).solve(np.array([1.0, -2.0, 0.3]))}
    found |= {"singular": str(factorise(np.ones((2, 2)))), "not finite": str(factorise(np.full((2, 2), np.nan)))}
    found |= {"outcomes": [f"{outcome.name} {outcome.value} {outcome.sentence}" for outcome in Outcome]}
    record.check(dataframe_regression, flat("", found))
