"""Planted melts and rubbers: how many intervals of 95 % hold the shift factors that were planted.

``python -m benchmarks superposition polymers [4]`` (families of each of the twelve materials)
"""

import sys
import time

import numpy as np

from mdr_dask.physics.superposition.master_curve import superpose

EXPANSION = 6e-4  # 1/K
WINDOW, POINTS = 2.5, 16  # decades of frequency, and points of each curve


def maxwell(frequency, times, moduli):
    """Return storage and loss modulus of a sum of Maxwell elements."""
    x = frequency[:, None] * times
    return np.sum(moduli * x**2 / (1 + x**2), axis=1), np.sum(moduli * x / (1 + x**2), axis=1)


def glass(random, low):
    """Return times and moduli of the transition to a glass: a power law from the time `low` down."""
    times = low * 10.0 ** -np.arange(0.0, 9.0, 0.25)
    rise = random.uniform(0.5, 0.7)
    return times, 10 ** random.uniform(5.3, 5.8) * (times / low) ** -rise * 0.25 * np.log(10)


def melt(random):
    """Doi and Edwards' odd modes with a log-normal spread of times, and a glass."""
    decades = random.uniform(2.5, 4.5)  # of the plateau
    modes, spread = np.arange(1, 32, 2), np.linspace(-2, 2, 17)
    share = np.exp(-(spread**2) / 2)
    times = (10.0 ** (random.uniform(0.1, 0.5) * spread)[:, None] / modes**2).ravel()
    moduli = (10 ** random.uniform(5.3, 6.0) * 8 / np.pi**2 * (share / share.sum())[:, None] / modes**2).ravel()
    stiff = glass(random, 10**-decades)
    return np.append(times, stiff[0]), np.append(moduli, stiff[1]), random.uniform(-1.5, 0.0)


def rubber(random):
    """A network, a weak power law and a glass."""
    times = 10.0 ** np.arange(-3.0, 6.0, 0.25)
    network = 10 ** random.uniform(5.5, 6.3)
    weak = network * random.uniform(0.05, 0.2) * times ** -random.uniform(0.1, 0.25) * 0.25 * np.log(10)
    stiff = glass(random, 1e-3)
    slow = np.append(times, stiff[0]), np.append(weak, stiff[1])
    return np.append(slow[0], 1e12), np.append(slow[1], network), random.uniform(-2.0, 0.5)


MATERIALS = [melt] * 7 + [rubber] * 5


def family(material, seed):
    """Return temperatures (K), curves of log10 G' and G'' over log10 of the frequency, and shift factors."""
    random = np.random.default_rng([material, seed])
    times, moduli, begin = MATERIALS[material](np.random.default_rng(100 + material))
    count = int(random.integers(4, 9))
    c1, c2 = random.uniform(10, 16), random.uniform(60, 150)
    steps = WINDOW * (1 - random.uniform(0.3, 0.6, count - 1))
    factors = np.append(0.0, np.cumsum(steps))[::-1]
    factors -= factors[count // 2]
    kelvins = 300 - c2 * factors / (c1 + factors)  # WLF with the reference at 300 K
    noise, offset = random.uniform(0.01, 0.03), random.uniform(0.01, 0.05)
    curves, x = [], np.linspace(0, WINDOW, POINTS)
    for kelvin, factor in zip(kelvins, factors, strict=True):
        place = x + factor - factors.min() + begin
        b_t = 300 / kelvin * (1 + EXPANSION * (kelvin - 300))
        scale = (1 + offset * random.standard_normal()) / b_t
        both = scale * np.array(maxwell(10**place, times, moduli))
        curves.append((x, np.log10(both * (1 + noise * random.standard_normal(both.shape)))))
    return kelvins, curves, factors


def judged(material, seed, channels=slice(2)):
    """Return errors over half widths of 95 % intervals, whether each holds, half widths, and processor time."""
    kelvins, curves, factors = family(material, seed)
    start = time.process_time()
    found = superpose(kelvins, [(x, y[channels]) for x, y in curves], "modulus")
    spent = time.process_time() - start
    low, high = found.interval()[:, : factors.size]
    others = found.groups != found.reference
    half = (high - low)[others] / 2
    held = ((low <= factors) & (factors <= high))[others]
    # order of the temperatures: no later curve lies certainly on the wrong side of an earlier one
    reversed_ = np.any(low[1:] > high[:-1])
    return np.abs(found.horizontal - factors)[others] / half, held, half, bool(reversed_), spent


def main(families=4, first=0):
    for name, channels in (("G' and G'' together", slice(2)), ("G' alone", slice(1))):
        found = [judged(m, s, channels) for m in range(len(MATERIALS)) for s in range(first, first + families)]
        ratios, held, half = (np.concatenate([each[k] for each in found]) for k in range(3))
        print(
            f"{name}: held {held.mean():.3f} of {held.size}, largest error {ratios.max():.2f} half widths, "
            f"median half width {np.median(half):.3f} decades, order reversed in {sum(each[3] for each in found)}, "
            f"median time {np.median([each[4] for each in found]):.2f} s"
        )


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
