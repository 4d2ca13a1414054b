"""Data, figure and tables of docs/validity.md on the validity of the method.

python -m benchmarks validity               compute missing data (20 surfaces of 512 x 512 points), then write the page
python -m benchmarks validity page          only write figure and tables

Stiffness, approach and contact of rough circular punches on a half-space (ContactMechanics) are compared with those of
the lines that replace them, without a free parameter. So is the friction of a sliding punch.
"""

from pathlib import Path

import numpy as np

from benchmarks.rows import table, with_tables
from benchmarks.surfaces import punches, sliding_punch

PAGE = Path(__file__).parents[2] / "docs/validity.md"
FIGURE = PAGE.parent / "evidence/validity.png"
TABLES = ("stiffness", "approach", "contact", "gap", "sliding")
POINTS = 512
BODIES = ("half-space", "line")


def collected(points):
    """Return arrays of approach, contact and gap (realisations, loads), by kind of body and Hurst exponent."""
    known = punches.rows().query(f"points == {points}").groupby(["body", "hurst"], sort=False)
    columns = ["approach", "contact", "gap"]
    return {key: np.moveaxis(each[columns].to_numpy().reshape(-1, punches.LOADS.size, 3), 2, 0) for key, each in known}


def stiffness(approach):
    """Return the stiffness dF/dd between neighbouring loads, over E* L, of each realisation."""
    return np.diff(punches.LOADS) / np.diff(approach, axis=1)


def ratio(line, surface, draws=2000):
    """Return the ratio of the means of line and surface, and its 95 % interval by resampling both."""
    generator = np.random.default_rng(0)
    means = [each[generator.integers(0, len(each), (draws, len(each)))].mean(axis=1) for each in (line, surface)]
    low, high = np.percentile(means[0] / means[1], [2.5, 97.5], axis=0)
    return line.mean(axis=0) / surface.mean(axis=0), low, high


def tables(found):
    """Yield the tables of stiffness, approach, contact and gap."""
    between, rows = np.sqrt(punches.LOADS[1:] * punches.LOADS[:-1]), []
    for hurst in punches.HURST:
        numbers = zip(*ratio(*(stiffness(found[body, hurst][0]) for body in ("line", "half-space"))), strict=True)
        rows.append((hurst, *(f"{middle:.2f} ({low:.2f}, {high:.2f})" for middle, low, high in numbers)))
    yield table(("H", *(f"{load:.1e}" for load in between)), rows)
    for column in range(3):
        rows = []
        for (body, hurst), numbers in sorted(found.items(), key=lambda item: (item[0][1], item[0][0])):
            each = numbers[column]
            error = 1.96 * each.std(axis=0, ddof=1) / np.sqrt(len(each))
            rows.append((hurst, body, *(f"{m:.3g} ± {e:.1g}" for m, e in zip(each.mean(axis=0), error, strict=True))))
        yield table(("H", "", *(f"{load:.0e}" for load in punches.LOADS)), rows)


def draw(found):
    """Write the figure with stiffness, approach and contact; each Hurst exponent has a column."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 8.5), layout="constrained")
    panels = figure.subplots(3, len(punches.HURST), sharex=True, squeeze=False)
    between = np.sqrt(punches.LOADS[1:] * punches.LOADS[:-1])
    names = ("stiffness dF/dd over E* L", "approach over rms height", "in contact: area, length")
    for column, hurst in enumerate(punches.HURST):
        for body, colour in zip(BODIES, ("k", "tab:orange"), strict=True):
            approach, contact, _ = found[body, hurst]
            for axes, x, values in zip(
                panels[:, column],
                (between, *[punches.LOADS] * 2),
                (stiffness(approach), approach, contact),
                strict=True,
            ):
                error = 1.96 * values.std(axis=0, ddof=1) / np.sqrt(len(values))
                label = f"{len(values)} surfaces" if body == "half-space" else f"{len(values)} lines"
                axes.errorbar(x, values.mean(axis=0), error, fmt="o-", ms=3, color=colour, label=label)
                axes.set_xscale("log")
                axes.grid(alpha=0.3)
        for row in (0, 2):
            panels[row, column].set_yscale("log")
        panels[0, column].set_title(f"H = {hurst}")
        panels[2, column].set_xlabel("load F / (E* L h)")
    for axes, name in zip(panels[:, 0], names, strict=True):
        axes.set_ylabel(name)
    panels[0, 0].legend(fontsize="small")
    figure.savefig(FIGURE, dpi=110)


def main(*arguments):
    """Compute missing data unless the argument is ``page``, and write figure and tables."""
    if "page" not in arguments:
        punches.compute(20, POINTS)
        sliding_punch.compute()
    draw(collected(POINTS))
    PAGE.write_text(text(PAGE.read_text()))


def text(page):
    """Return the text of the page with the current tables."""
    *parts, sliding = *tables(collected(POINTS)), table(sliding_punch.HEAD, sliding_punch.table_of_cases())
    return with_tables(page, dict(zip(TABLES, (*parts, sliding), strict=True)))
