"""Families of curves with known shift factors: coverage of the intervals, and errors of the factors."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.solvers.solver import Found, Solver, Truth
from mdr_dask.physics.superposition.master_curve import Vertical, superpose

SHAPES = {
    "sigmoid": lambda x: 2 * np.tanh(x / 2),
    "nearly straight": lambda x: 0.5 * x + 0.02 * x**2,
    "bump": lambda x: np.exp(-(x**2) / 2),
    "power law": lambda x: 0.3 * x,
    "flat plateau": lambda x: -0.2 * np.logaddexp(0, -3 * x),
}
ON_PLATEAUS = {
    "sigmoid": lambda x: np.tanh(x / 5),
    "steep": lambda x: 2 + 1.5 * np.tanh(x / 2),
    "decay": lambda x: -np.log10(1 + 10**x),
}
#: Settings: shape, number of curves, points per curve, relative scatter of the ordinate, and overlap of neighbours.
PLATEAUS = (
    ("decay", 15, 10, 0.02, 0.3),
    ("decay", 15, 20, 0.005, 0.3),
    ("decay", 15, 20, 0.02, 0.6),
    ("decay", 8, 20, 0.02, 0.3),
    ("decay", 3, 20, 0.02, 0.3),
    ("steep", 15, 10, 0.02, 0.3),
    ("steep", 15, 20, 0.005, 0.3),
    ("steep", 15, 20, 0.02, 0.6),
    ("steep", 5, 20, 0.01, 0.4),
    ("sigmoid", 15, 10, 0.02, 0.3),
    ("sigmoid", 8, 20, 0.005, 0.5),
    ("sigmoid", 3, 10, 0.02, 0.3),
)
EXPANSION = 6e-4  # thermal expansion of polymers, 1/K
WINDOW, POINTS = 2.5, 16  # decades of frequency and number of points of each curve of a polymer


class Family(NamedTuple):
    """A family of curves with known shift factors.

    `curves` contains log10 of abscissa and ordinate. `factors` are in decades, and zero for the reference.
    """

    groups: np.ndarray
    curves: list[tuple[np.ndarray, np.ndarray]]
    factors: np.ndarray
    vertical: Vertical = "none"

    @property
    def reference(self) -> float:
        """Value of the group whose factor is zero."""
        return float(self.groups[np.flatnonzero(self.factors == 0)[0]])

    def merged(self) -> Found:
        """Return the horizontal factors of all other groups, and the half widths of their 95 % intervals."""
        found = superpose(self.groups, self.curves, self.vertical, self.reference)
        low, high = found.interval()[:, : self.groups.size]
        others = self.factors != 0
        return Found(found.horizontal[others], ((high - low) / 2)[others])


def on_a_shape(shape: str, random: np.random.Generator, scatter: float = 0.01) -> Family:
    """Draw a family of ten curves of thirty points, two decades wide and 0.2 to 0.6 decades apart."""
    factors = np.append(0, np.cumsum(random.uniform(0.2, 0.6, 9)))
    factors -= factors[5]
    x = np.linspace(-1, 1, 30)
    curves = [(x, SHAPES[shape](x + factor) + scatter * random.standard_normal(30)) for factor in factors]
    return Family(np.arange(10.0), curves, factors)


def on_a_plateau(setting: tuple[str, int, int, float, float], random: np.random.Generator) -> Family:
    """Draw curves two decades wide that approach a plateau; the distances of neighbours vary by an eighth."""
    shape, count, points, noise, overlap = setting
    steps = 2 * (1 - overlap) * (1 + 0.25 * random.uniform(-0.5, 0.5, count - 1))
    factors = np.append(0, np.cumsum(steps))
    factors -= factors[count // 2]
    x = np.linspace(-1, 1, points)
    scatter = np.log10(1 + noise * random.standard_normal((count, points)))
    curves = [(x, ON_PLATEAUS[shape](x + factor) + each) for factor, each in zip(factors, scatter, strict=True)]
    return Family(np.arange(float(count)), curves, factors)


def maxwell(frequency: np.ndarray, times: np.ndarray, moduli: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return storage and loss modulus of a sum of Maxwell elements."""
    x = frequency[:, None] * times
    return np.sum(moduli * x**2 / (1 + x**2), axis=1), np.sum(moduli * x / (1 + x**2), axis=1)


def glass(random: np.random.Generator, low: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times and moduli of a glass transition: a power law at times below `low`."""
    times = low * 10.0 ** -np.arange(0.0, 9.0, 0.25)
    rise = random.uniform(0.5, 0.7)
    return times, 10 ** random.uniform(5.3, 5.8) * (times / low) ** -rise * 0.25 * np.log(10)


def melt(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """Draw a melt: the odd modes of Doi and Edwards with log-normally spread times, and a glass transition.

    Return times, moduli, and the decade at which the frequencies begin.
    """
    decades = random.uniform(2.5, 4.5)  # width of the plateau
    modes, spread = np.arange(1, 32, 2), np.linspace(-2, 2, 17)
    share = np.exp(-(spread**2) / 2)
    times = (10.0 ** (random.uniform(0.1, 0.5) * spread)[:, None] / modes**2).ravel()
    moduli = (10 ** random.uniform(5.3, 6.0) * 8 / np.pi**2 * (share / share.sum())[:, None] / modes**2).ravel()
    stiff = glass(random, 10**-decades)
    return np.append(times, stiff[0]), np.append(moduli, stiff[1]), random.uniform(-1.5, 0.0)


def rubber(random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """Draw a rubber: a network, a weak power law and a glass transition; return as `melt`."""
    times = 10.0 ** np.arange(-3.0, 6.0, 0.25)
    network = 10 ** random.uniform(5.5, 6.3)
    weak = network * random.uniform(0.05, 0.2) * times ** -random.uniform(0.1, 0.25) * 0.25 * np.log(10)
    stiff = glass(random, 1e-3)
    slow = np.append(times, stiff[0]), np.append(weak, stiff[1])
    return np.append(slow[0], 1e12), np.append(slow[1], network), random.uniform(-2.0, 0.5)


POLYMERS = (melt,) * 7 + (rubber,) * 5


def of_a_polymer(number: int, random: np.random.Generator, channels: slice = slice(2)) -> Family:
    """Draw noisy moduli of one of the twelve polymers at four to eight temperatures, with WLF factors and b_T."""
    times, moduli, begin = POLYMERS[number](np.random.default_rng(100 + number))
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
        curves.append((x, np.log10(both * (1 + noise * random.standard_normal(both.shape)))[channels]))
    return Family(kelvins, curves, factors, "modulus")


def drawn(kind, *choices):
    """Return a function that draws a family: it calls `kind` with one of the choices, taken at random."""

    def draw(random: np.random.Generator) -> tuple[Family, Truth]:
        family = kind(choices[random.integers(len(choices))], random)
        return family, Truth(family.factors[family.factors != 0])

    return draw


SOLVERS = (
    Solver(
        "master curves",
        {
            "ten curves, five shapes": drawn(on_a_shape, *SHAPES),
            "curves that end in a plateau": drawn(on_a_plateau, *PLATEAUS),
            "G' and G'' of melts and rubbers": drawn(of_a_polymer, *range(12)),
            "G' of melts and rubbers": drawn(partial(of_a_polymer, channels=slice(1)), *range(12)),
        },
        {"superposition": {"": Family.merged}},
        rounds=1,
    ),
)
