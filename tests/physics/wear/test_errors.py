"""Stated errors of worn contacts against finer solutions, and little wear against its first order in closed form."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import hyp2f1

from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.wear.accuracy import checked_exact, checked_history
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.history import LoadBlock

PLACES = np.linspace(0.0, 1.6, 161)
NUMBERS = ("contact_radius", "stick_border", "depth", "normal_force", "wear_volume", "worn_depth")


def held(found, true):
    """Return whether the stated error of each output holds."""
    gaps = {name: np.abs(found.worn.value(name, PLACES) - true.value(name, PLACES)) for name in found.errors}
    return [np.nanmax(gaps[name]) <= error + 1e-12 for name, error in found.errors.items()]


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [None, 1e-2, 1e-3])
@pytest.mark.parametrize("constant_force", [False, True])
@pytest.mark.parametrize("slips", [False, True], ids=["partial slip", "gross slip"])
def test_stated_errors_hold(slips, constant_force, accuracy):
    """Random bodies, some next to full stick, after few and many cycles."""
    prescribed = "normal_force" if constant_force else "depth"
    rng, found, names = np.random.default_rng(20), [], sorted({*NUMBERS, "height"} - {prescribed})
    for number in range(12):
        n = float(np.exp(rng.uniform(np.log(0.5), np.log(20.0))))
        c = float(rng.uniform(0.05, 0.97)) if number % 6 else 1.0 - 10.0 ** float(rng.uniform(-5.0, -2.0))
        amounts = sorted((10.0 ** rng.uniform(-2.0 if slips else -4.0, 1.1, 3)).tolist())
        profile, stick = PowerProfile(n), 0.0 if slips else c
        truth = exact(profile, stick, amounts, 3e-5, constant_force=constant_force)
        contacts = checked_exact(profile, stick, amounts, names, PLACES, accuracy, constant_force=constant_force)
        found += [held(contact, true) for contact, true in zip(contacts, truth, strict=True)]
    shares = np.mean(found, axis=0)
    print(dict(zip(names, shares, strict=True)))
    assert np.all(shares >= 0.94)  # 36 contacts: two of them may miss


@pytest.mark.parametrize("accuracy", [4e-3, 1e-3])
@pytest.mark.parametrize(("exponent", "c"), [(2.0, 0.222), (1.37, 0.8), (4.608, 0.1109), (1.0, 0.5), (2.0, 0.999)])
def test_little_wear_is_of_the_first_order(exponent, c, accuracy):
    """To first order f - f0 = N p0 s0 of the virgin contact; it was up to 45 % off below N = 1e-4."""
    profile, eta = PowerProfile(exponent), -np.expm1(exponent * np.log(c))
    radii = c + (1.0 - c) * np.array([0.1, 0.4, 0.7, 0.9])

    def slip(r):
        angle = np.arctan2(np.sqrt((r - c) * (r + c)), c)
        term = lambda t: float(profile.rise(np.array(2 * r * np.sin((angle + t) / 2) * np.sin((angle - t) / 2)), c))  # noqa: E731
        return 2.0 / np.pi * quad(term, 0.0, angle)[0]

    share = 1.0 - radii**2
    virgin = exponent / np.pi * np.sqrt(share) * hyp2f1(1, 1 - exponent / 2, 1.5, share)
    first = virgin * np.array([slip(r) for r in radii]) / eta
    cycles = np.sqrt((1.0 - c) * (1.0 + c)) * np.array([1e-6, 1e-5, 1e-4])  # in the time in which the contact changes
    for n, worn in zip(cycles, exact(profile, c, cycles, accuracy), strict=True):
        np.testing.assert_allclose((worn.height(radii) - profile.height(radii)) / n, first, rtol=0.02, atol=2e-16 / n)


@pytest.mark.parametrize("exponent", [0.6, 1.0, 1.4])
def test_a_sharp_tip_is_worn_to_the_accuracy_asked(exponent):
    rough, fine = (exact(PowerProfile(exponent), 0.0, [0.1], one)[0] for one in (1e-3, 1e-4))
    assert abs(rough.worn_depth / fine.worn_depth - 1.0) < 0.01


def test_a_step_that_leaves_the_numbers_fails_without_a_warning():
    (worn,) = exact(PowerProfile(6.804484763820827), 0.9977872552149678, [14.4], 1e-4, constant_force=True)
    assert worn.depth > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["depth", "force"])
@pytest.mark.parametrize(("exponent", "c"), [(2.0, 0.455), (1.0, 0.4), (3.0, 0.6)])
def test_estimates_of_histories_hold_before_and_after_the_image_jumps(exponent, c, hold):
    profile, eta, force = PowerProfile(exponent), 1.0 - c**exponent, 2.0 * exponent / (exponent + 1.0)
    kept = {"depth": 1.0} if hold == "depth" else {"force": force}
    blocks = [LoadBlock(cycles, eta, **kept) for cycles in (0.3, 1.7, 6.0)]
    truth = exact(profile, c, [0.3, 2.0, 8.0], 2e-4, constant_force=hold == "force")
    for found, true in zip(checked_history(profile, blocks, ["height"], PLACES, 80, 2.0), truth, strict=True):
        assert held(found, true) == [True]
