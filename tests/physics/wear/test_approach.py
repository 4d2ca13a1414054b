"""How near contacts at constant depth are to their end: the bound and its lower slip against evolutions."""

import numpy as np
import pytest

from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear import approach
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.rules import limit


@pytest.mark.slow
@pytest.mark.parametrize(("exponent", "c"), [(2.0, 0.455), (0.6, 0.8), (1.0, 0.3), (4.0, 0.3), (8.0, 0.8), (2.0, 0.99)])
def test_the_end_is_no_farther_than_the_bound(exponent, c, monkeypatch):
    profile = PowerProfile(exponent)
    end, area = limit(profile, c), (1.0 - c) * (1.0 + c)
    cycles = [float(n * np.sqrt(area)) for n in (1.0, 8.0, 30.0, 60.0, 100.0)]
    bounds = [approach._bound(profile, end, n) for n in cycles]
    monkeypatch.setattr("mdr_dask.physics.wear.exact.nearly_limit", lambda *_: {})
    radii = np.linspace(c, 1.02 * end.contact_radius, 300)
    for worn, bound in zip(exact(profile, c, cycles, 3e-4, errors=False), bounds, strict=True):
        profiles = np.max(np.abs(worn.height(radii) - end.height(radii))) / (1.0 - float(profile.image(np.array(c))))
        numbers = [
            abs(worn.value(name, radii) / end.value(name, radii) - 1.0) for name in ("wear_volume", "normal_force")
        ]
        assert max(profiles, *numbers) <= bound + 5e-4  # the evolution has an error too
    assert bounds[-1] < 0.05


@pytest.mark.parametrize(("exponent", "c"), [(2.0, 0.455), (1.0, 0.3), (3.0, 0.7)])
@pytest.mark.parametrize("layer", [0.03, 0.3])
def test_slip_stays_above_what_grows_no_faster_than_itself(exponent, c, layer):
    """The proof's lower slip, at an x_1 of its own, against the evolution from a tenth of a cycle on."""
    profile, end = PowerProfile(exponent), limit(PowerProfile(exponent), c)
    eta, x1 = 1.0 - c**exponent, c + layer * (1.0 - c)
    first = float(profile.rise(np.array(x1 - c), c)) / eta
    rate = 1.0 / (np.pi * np.sqrt((end.contact_radius - c) * (end.contact_radius + c)))
    radii = np.linspace(c, end.contact_radius, 40)[1:-1]
    abscissa, weight = gauss(400)
    span = np.arccos(c / radii)[:, None]
    image = np.minimum(profile.rise(radii[:, None] * np.cos(span * abscissa) - c, c) / (first * eta), 1.0)
    below = 2.0 / np.pi * span[:, 0] * (image @ weight)
    cycles = [0.1, 1.0, 4.0, 12.0, 40.0]
    for n, worn in zip(cycles, exact(profile, c, cycles, 1e-4, errors=False), strict=True):
        share = first / (first + (1.0 - first) * np.exp(-rate * n))
        missing = 2.0 / np.pi * span[:, 0] - share * below
        assert np.all(worn.height(radii) >= end.height(radii) - eta * missing - 2e-4)
        assert np.all(worn.height(radii) <= end.height(radii) + 2e-4)


def test_after_many_cycles_the_limit_answers_within_its_bound():
    """They were followed, for a hundred times the time, and what was asked beside them is what it was."""
    profile = PowerProfile(2.0)
    many, few = exact(profile, 0.455, [300.0, 2.0], 1e-4)
    assert many.steps == 0
    assert few.steps > 10
    assert few.contact_radius == exact(profile, 0.455, [2.0], 1e-4)[0].contact_radius
    assert many.contact_radius == limit(profile, 0.455).contact_radius
    assert 0.0 < many.error("wear_volume", np.ones(1)) <= 1e-4 * many.wear_volume
    assert many.energy_volume == many.wear_volume


@pytest.mark.parametrize(("exponent", "c"), [(2.0, 1e-6), (0.3, 0.01), (50.0, 0.1), (2.0, 1.0 - 1e-9), (8.0, 0.5)])
@pytest.mark.parametrize("cycles", [0.0, 1e-6, 1.0, 1e3, 1e6, 1e12])
def test_the_bound_is_a_number_at_extremes(exponent, c, cycles):
    profile = PowerProfile(exponent)
    bound = approach._bound(profile, limit(profile, c), cycles)
    assert 0.0 < bound < np.inf
    assert bound < 1e-3 or cycles < 1e4
