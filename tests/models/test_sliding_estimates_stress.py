"""Sliding friction against a slow reference of its own: right to its estimate, for any material, body and line."""

from math import gamma, pi, sqrt

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from references.slow_friction import Body, reference, samples, waves

from mdr_dask.models.base import Block, Status
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.surfaces import roughness

POINTS, SEED = 32, 7
LINE = {"length": 1.0, "points": POINTS}
OUTPUTS = ("friction_coefficient", "friction_coefficient_error")
UNKNOWN = 0.02  # doubt of the reference that is too large to judge by
SURE = 1e-3  # which the reference is never trusted beyond
WORST = 20.0  # times its estimate that an error may be once in a while


def solved(parameters, realisation=0, accuracy=0.01):
    case = SlidingFriction.model_validate(parameters | {"velocity": 1.0})
    result = MODEL.compute(Block(case, {}, 1, (realisation,), SEED, OUTPUTS, accuracy))
    assert result.status[0, 0] == Status.DONE, result.messages
    friction, error = (result.values[name].item() for name in OUTPUTS)
    return friction, error / friction


class Judge:
    """Errors over what they may be: the estimate of the model and the doubt of the reference."""

    def __init__(self):
        self.ratios = set()  # examples are drawn more than once

    def __call__(self, exact, parameters, realisation=0):
        assume(exact is not None and exact.doubt < UNKNOWN)
        friction, estimate = solved(parameters | {"normal_force": 4 * exact.load}, realisation)
        self.ratios.add(abs(friction / exact.friction - 1) / (estimate + max(2 * exact.doubt, SURE)))

    def holds(self, cases):
        """19 of 20 are below their estimate, within 4 sigma since extremes come more often, and none is far above."""
        ratios = np.array(list(self.ratios))
        assert ratios.size >= cases
        assert np.sum(ratios > 1) <= 0.05 * ratios.size + 4 * np.sqrt(0.05 * 0.95 * ratios.size)
        assert max(ratios) < WORST


def kelvin(deborah):
    return Body(np.empty(0), np.empty(0), deborah), {"shear_modulus": 1.0, "relaxation_time": deborah}


def series(moduli, deborahs, dashpot):
    prony = {"static_modulus": 1.0, "moduli": tuple(moduli), "times": tuple(deborahs), "viscosity": dashpot}
    return Body(np.array(moduli), np.array(deborahs), dashpot), {"material": {"prony": prony}}


def decades(low, high):
    return st.floats(low, high).map(lambda exponent: 10**exponent)


dashpots = st.one_of(st.just(0.0), decades(-6, 0))
few_arms = st.integers(1, 4).flatmap(
    lambda arms: st.builds(
        series,
        st.lists(decades(-2, 2), min_size=arms, max_size=arms),
        st.lists(decades(-6, 5), min_size=arms, max_size=arms, unique=True),
        dashpots,
    )
)
fifty_arms = st.integers(0, 2**32).map(
    lambda seed: series(10 ** np.random.default_rng(seed).uniform(-2, 2, 50), np.geomspace(1e-10, 1e10, 50), 0.0)
)
MATERIALS = {"kelvin": decades(-7, 5).map(kelvin), "few": few_arms, "fifty": fifty_arms}
EXAMPLES = {"kelvin": 40, "few": 40, "fifty": 12}


@pytest.mark.parametrize("kind", MATERIALS)
def test_planes_are_right_to_their_own_estimates(kind):
    """From one point in contact to all of the line."""
    judge = Judge()

    @settings(max_examples=EXAMPLES[kind], deadline=None, database=None)
    @given(material=MATERIALS[kind], hurst=st.floats(0, 1), share=decades(-3, 1), realisation=st.integers(0, 1000))
    def draw(material, hurst, share, realisation):
        line = waves(roughness.amplitudes(POINTS // 2, hurst), roughness.phases(SEED, realisation, POINTS // 2))
        depth = 2 * share - line(4097).max()
        body, parameters = material
        judge(reference(line, depth, body), parameters | LINE | {"hurst": hurst, "rms_roughness": 1.0}, realisation)

    draw()
    judge.holds(0.6 * EXAMPLES[kind])


@pytest.mark.parametrize("rough", [True, False], ids=["rough", "smooth"])
@pytest.mark.parametrize("kind", MATERIALS)
def test_indenters_are_right_to_their_own_estimates(kind, rough):
    """Bodies of exponents 1 to 6 whose contact takes 2 to 40 % of the line, from flat to steep ones."""
    judge = Judge()

    @settings(max_examples=EXAMPLES[kind] // 2, deadline=None, database=None)
    @given(
        material=MATERIALS[kind],
        hurst=st.floats(0, 1),
        exponent=st.floats(1, 6),
        half=decades(-2, -0.7),
        steepness=decades(-1, 1.5),
        realisation=st.integers(0, 1000),
    )
    def draw(material, hurst, exponent, half, steepness, realisation):
        amplitude = roughness.amplitudes(POINTS // 2, hurst)
        coefficient = steepness * roughness.spectral_slope(amplitude) / (exponent * half ** (exponent - 1))
        roughly = waves(rough * amplitude, roughness.phases(SEED, realisation, POINTS // 2))

        def line(nodes):
            return roughly(nodes) - coefficient * np.abs(np.linspace(-0.5, 0.5, nodes)) ** exponent

        body, parameters = material
        mapped = sqrt(pi) / 2 * exponent * gamma(exponent / 2) / gamma((exponent + 1) / 2)
        indenter = {"shape": "power", "exponent": exponent, "coefficient": coefficient / mapped}
        parameters = parameters | LINE | {"indenter": indenter, "hurst": hurst, "rms_roughness": float(rough)}
        judge(reference(line, coefficient * half**exponent, body, periodic=False), parameters, realisation)

    draw()
    judge.holds(0.2 * EXAMPLES[kind])


@pytest.mark.parametrize("shape", ["spikes", "steps", "saw", "noise"])
def test_measured_lines_are_right_to_their_own_estimates(tmp_path, shape):
    """A measured line is the band-limited one through its samples, however they jump."""
    judge, path = Judge(), tmp_path / "line.csv"

    @settings(max_examples=15, deadline=None, database=None)
    @given(
        material=st.one_of(MATERIALS["kelvin"], few_arms),
        seed=st.integers(0, 1000),
        height=decades(-9, 3),
        share=decades(-2.5, 0.5),
    )
    def draw(material, seed, height, share):
        random, count = np.random.default_rng(seed), 64
        z = (
            height
            * {
                "spikes": np.where(random.uniform(size=count) < 0.1, random.exponential(10, count), 0.0),
                "steps": np.repeat(random.standard_normal(8), 8),
                "saw": (np.arange(count) % 16) / 16,
                "noise": random.standard_normal(count),
            }[shape]
        )
        assume(np.ptp(z) > 0)
        np.savetxt(
            path,
            np.column_stack([np.arange(count) / count, z]),
            delimiter=",",
            header="x [m],z [m]",
            comments="",
            fmt="%.17g",
        )
        line = samples(z - z.mean())
        heights = line(4097)
        body, parameters = material
        depth = share * np.ptp(heights) - heights.max()
        parameters = parameters | {"surface": {"profile": str(path)}}
        judge(reference(line, depth, body), parameters)

    draw()
    judge.holds(9)
