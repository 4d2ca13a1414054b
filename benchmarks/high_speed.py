"""Friction at very high velocity, for the figure of docs/high-speed.md: ``python -m benchmarks high_speed [PNG]``.

There are twenty lines with H = 0.7 and 1000 Nyquist points, at F_N / (G h L) = 0.3. The command also prints the numbers
in the text of the page.
"""

import numpy as np

from mdr_dask.physics.sliding.problem import PronyTerms, Request, solve
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves

POINTS, LINES, HURST, LOAD = 1000, 20, 0.7, 0.3 / 4
DEBORAH = np.geomspace(1e-5, 1e4, 28)  # v tau / L
GLASS = 100.0  # ratio of glassy to static modulus of the standard solid
FINE = 64


def main(path: str = "docs/pictures/high-speed.png") -> None:
    """Compute the curves, print the numbers in the page, and draw the figure."""
    amplitude = roughness.amplitudes(POINTS // 2, HURST)
    slope = roughness.spectral_slope(amplitude)
    loads = np.full(DEBORAH.size, LOAD)
    curves: dict[str, list[np.ndarray]] = {}
    ratios, tips, plateaus = [], [], {1: [], 4: [], 16: []}
    for line in range(LINES):
        waves = Waves(0.5 * amplitude * roughness.phase_factors(2013, line, POINTS // 2), POINTS)
        rough = RoughLine(waves)
        height, cell = waves.heights(POINTS * FINE), 1 / (POINTS * FINE)
        top = int(np.argmax(height))
        curvature = (2 * height[top] - height[top - 1] - height[(top + 1) % height.size]) / cell**2
        kelvin, _ = solve(rough, None, DEBORAH, loads, Request(0.01))
        friction = kelvin.drag / LOAD
        curves.setdefault("Kelvin solid", []).append(friction)
        ratios.append(friction / kelvin.contact_slope)
        tips.append(friction[-1] / single_tip(curvature, 4 * LOAD, 1.0, DEBORAH[-1]))
        curves.setdefault("one parabolic tip", []).append(single_tip(curvature, 4 * LOAD, 1.0, DEBORAH))
        for oversampling in plateaus:
            steps, _ = solve(rough, None, DEBORAH, loads, Request(0.01, oversampling, "backward_euler", False, False))
            curves.setdefault(f"time steps, {oversampling} nodes per Nyquist point", []).append(steps.drag / LOAD)
            nodes = waves.heights(POINTS * oversampling)
            highest = int(np.argmax(nodes))
            plateaus[oversampling].append((nodes[highest] - nodes[highest - 1]) * nodes.size)
        solid = []
        for deborah in DEBORAH:  # G_m tau_m is G tau of the Kelvin solid: equal friction at low velocity
            terms = PronyTerms((GLASS - 1,), (deborah / (GLASS - 1),))
            solid.append(solve(rough, terms, np.zeros(1), loads[:1], Request(0.02))[0].drag[0] / LOAD)
        curves.setdefault(f"standard solid, glassy modulus {GLASS:g} G", []).append(np.array(solid))
    means = {name: np.nanmean(rows, axis=0) / slope for name, rows in curves.items()}
    print("v tau / L", *(f"{deborah:9.1e}" for deborah in DEBORAH[::3]))
    for name, mean in means.items():
        print(f"mu / slope, {name}:", *(f"{each:.4g}" for each in mean[::3]))
    print("mu / slope in contact, Kelvin solid:", *(f"{each:.4f}" for each in np.mean(ratios, axis=0)[::3]))
    print(f"over one parabolic tip at the highest velocity: {np.min(tips):.4f} to {np.max(tips):.4f}")
    for oversampling, rises in plateaus.items():
        print(f"{oversampling} nodes: rise to the highest node / slope, mean {np.mean(rises) / slope:.4f}")
    print(f"grid of the thesis, 5000 nodes, 200 lines: rise to the highest node / slope, mean {_thesis():.3f}")
    _draw(means, path)


def single_tip(curvature, force, viscosity, velocity):
    """Return mu of one parabolic tip of a viscous foundation, (2/3) sqrt(kappa F_N / (2 eta v))."""
    return 2 / 3 * np.sqrt(curvature * force / (2 * viscosity * velocity))


def _thesis() -> float:
    """Return the mean of (h_top - h_before) / (dx slope) over 200 lines, on the grid of the thesis."""
    amplitude = roughness.amplitudes(2500, HURST)
    rises = []
    for line in range(200):
        nodes = Waves(0.5 * amplitude * roughness.phase_factors(2013, line, 2500), 5000).heights(5000)
        highest = int(np.argmax(nodes))
        rises.append((nodes[highest] - nodes[highest - 1]) * nodes.size)
    return float(np.mean(rises) / roughness.spectral_slope(amplitude))


def _draw(means: dict[str, np.ndarray], path: str) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.5, 4.2), layout="constrained")
    styles = {"Kelvin solid": "k-", "one parabolic tip": "k:"}
    for name, mean in means.items():
        line = styles.get(name, "--" if name.startswith("time") else "-")
        shown = mean < 2 if name == "one parabolic tip" else np.full(mean.size, True)
        axes.loglog(DEBORAH[shown], mean[shown], line, label=name)
    axes.set_xlabel(r"$v \tau / L$")
    axes.set_ylabel("coefficient of friction over rms slope")
    axes.set_ylim(3e-3, 3)
    axes.legend(fontsize="small")
    figure.savefig(path, dpi=150)
