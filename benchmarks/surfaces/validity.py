"""Make docs/validity.md: ``python -m benchmarks surfaces validity [SURFACES POINTS]``, from what is known or missing.

Stiffness, approach and contact of rough circular punches on a half-space (ContactMechanics), and of the lines of the
method beside them, without a free parameter.
"""

import sys
from pathlib import Path

import numpy as np

from benchmarks.surfaces import punches, sliding_punch

PAGE = Path(__file__).parents[2] / "docs/validity.md"
FIGURE = PAGE.parent / "evidence/validity.png"
TEXT = Path(__file__).with_name("validity.txt")
BODIES = ("half-space", "line")


def collected(points):
    """Return arrays (bodies, loads) of approach, contact and gap by body and Hurst exponent."""
    found = {}
    for row in punches.rows():
        if int(row["points"]) == points:
            key = row["body"], float(row["hurst"])
            numbers = [float(row[name]) for name in ("approach", "contact", "gap")]
            found.setdefault(key, {}).setdefault(int(row["index"]), []).append(numbers)
    return {key: np.array(list(each.values())).transpose(2, 0, 1) for key, each in found.items()}


def stiffness(approach):
    """Return dF/dd over E* L between loads, in each body."""
    return np.diff(punches.LOADS) / np.diff(approach, axis=1)


def ratio(line, surface, draws=2000):
    """Return the ratio of the means over bodies, and its 95 % interval by resampling both."""
    generator = np.random.default_rng(0)
    means = [each[generator.integers(0, len(each), (draws, len(each)))].mean(axis=1) for each in (line, surface)]
    low, high = np.percentile(means[0] / means[1], [2.5, 97.5], axis=0)
    return line.mean(axis=0) / surface.mean(axis=0), low, high


def tables(found):
    """Return the rows of the tables of stiffness, approach and contact as Markdown."""
    between = np.sqrt(punches.LOADS[1:] * punches.LOADS[:-1])
    parts = ["| H | " + " | ".join(f"{load:.1e}" for load in between) + " |\n|" + "---|" * (between.size + 1)]
    for hurst in punches.HURST:
        line, surface = (stiffness(found[body, hurst][0]) for body in ("line", "half-space"))
        cells = [
            f"{middle:.2f} ({low:.2f}, {high:.2f})" for middle, low, high in zip(*ratio(line, surface), strict=True)
        ]
        parts.append(f"| {hurst} | " + " | ".join(cells) + " |")
    yield "\n".join(parts)
    head = (
        "| H | | " + " | ".join(f"{load:.0e}" for load in punches.LOADS) + " |\n|" + "---|" * (punches.LOADS.size + 2)
    )
    for column in range(3):
        rows = [head]
        for hurst in punches.HURST:
            for body in BODIES:
                each = found[body, hurst][column]
                error = 1.96 * each.std(axis=0, ddof=1) / np.sqrt(len(each))
                cells = [f"{m:.3g} ± {e:.1g}" for m, e in zip(each.mean(axis=0), error, strict=True)]
                rows.append(f"| {hurst} | {body} | " + " | ".join(cells) + " |")
        yield "\n".join(rows)


def draw(found):
    """Write the figure: stiffness, approach, contact; a column each Hurst exponent."""
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


def main(surfaces=20, points=512):
    punches.compute(surfaces, points)
    sliding_punch.compute()
    page(points)


def page(points):
    """Write page and figure from the tables of evidence."""
    draw(collected(points))
    PAGE.write_text(text(points))


def text(points):
    """Return the page from the tables of evidence."""
    found = collected(points)
    ratios, approach, contact, gap = tables(found)
    number = min(len(found["half-space", hurst][0]) for hurst in punches.HURST)
    worst = [
        ratio(*(stiffness(found[body, hurst][0]) for body in ("line", "half-space")))[0] for hurst in punches.HURST
    ]
    head, *cases = sliding_punch.HEAD, *sliding_punch.table_of_cases()
    sliding = "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *cases))
    shares = [row["line"] / row["friction"] for row in sliding_punch.rows()]
    return TEXT.read_text().format(
        sliding=sliding,
        friction_low=min(shares),
        friction_high=max(shares),
        miss=np.max(np.abs(np.array(worst) - 1)),
        surfaces=number,
        points=points,
        lines=punches.LINES,
        low=np.min(worst),
        high=np.max(worst),
        ratios=ratios,
        approach=approach,
        contact=contact,
        gap=gap,
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
