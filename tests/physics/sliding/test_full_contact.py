"""Full contact in closed form, compared with fine grids, and the load at which it ends."""

import numpy as np
import pytest
from schemes import sampled

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding import problem
from mdr_dask.physics.sliding.problem import PronyTerms, Request
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import waves_of


def _line(modes, seed=1):
    phase = roughness.phases(seed=seed, realisation=0, modes=modes)
    return RoughLine(waves_of(sampled(roughness.amplitudes(modes, hurst=0.7), phase, 2 * modes + 2)))


def _rms(line):
    return np.sqrt(2 * np.sum(np.abs(line.roughness.coefficients) ** 2))


@pytest.mark.parametrize("terms", [None, PronyTerms((3.0,), (0.02,)), PronyTerms((3.0, 5.0), (0.1, 0.01))])
@pytest.mark.parametrize("modes", [2, 60])
def test_full_contact_is_what_grids_tend_to(terms, modes):
    line, deborah = _line(modes), np.array([1e-4, 1e-3, 1e-2])
    loads = np.full(3, 100.0) * _rms(line)
    found, errors = problem.solve(line, terms, deborah, loads, Request())
    truth, doubt = problem.solve(line, terms, deborah, loads, Request(oversampling=32))
    assert np.all(found.contact_fraction == 1.0)
    for one, true, error, doubted in zip(found.columns, truth.columns, errors, doubt, strict=True):
        assert np.all(error <= 1e-12 * one)
        assert np.all(np.abs(one - true) <= doubted + 1e-9 * true)
        np.testing.assert_allclose(one, true, rtol=1e-10 if terms is None else 1e-4)


@pytest.mark.parametrize("terms", [(), ((3.0, 0.02),)])
@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_that_lifts_off_counts_as_full_contact(terms, seed):
    """Full contact never begins below the load at which the pressure is zero somewhere, found on many more nodes."""
    line, deborah = _line(40, seed), np.array([1e-3])
    modulus = 1 + sum(g * 2j * np.pi * np.arange(1, 42) * t / (1 + 2j * np.pi * np.arange(1, 42) * t) for g, t in terms)
    wave = type(line.roughness)(line.roughness.coefficients * np.broadcast_to(modulus, 41), line.points)
    least = -np.min(wave.heights(4096) + deborah * line.roughness.slopes(4096))
    pairs = None if not terms else PronyTerms(*zip(*terms, strict=True))
    for share in (0.5, 0.999, 1.5, 2.5):
        steady, errors = problem.solve(line, pairs, deborah, np.array([share * least]), Request(accuracy=0.05))
        assert steady.status[0] == Outcome.CONVERGED
        closed = errors[0][0] <= 1e-11 * steady.drag[0]
        if share != 1.5:  # at this load, the solver finds full contact on some lines only
            assert closed == (share > 2.0)
