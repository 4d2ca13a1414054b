"""Error against run time of the rules of wear, side by side: ``python -m benchmarks wear work_precision``.

The case is figure 6.2's (parabola, c = 0.455 a0) at N = 2 and N = 8; errors are the largest difference of f from the
exact evolution at accuracy 1e-5, over 400 radii from 0 to 1.4 a0, in d0. Times are processor times. ``--figure FILE``
draws the table.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.measures import Curve, draw_errors, print_table, timed
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.rules import fast, fast_cases, limit_cases
from mdr_dask.physics.wear.worn import Worn

PARABOLA = PowerProfile(2.0)
STICK = 0.455
RADII = np.linspace(0.0, 1.4, 400)


class Row(NamedTuple):
    method: str
    setting: str
    cycles: float
    seconds: float
    error: float


def fast_seconds(cases: int = 20000) -> float:
    """Return the processor time of one case of the fast rule among many: a(c) solved, scar, volume and force."""
    c, n = np.linspace(0.05, 0.95, cases), np.full(cases, 2.0)

    def run(some: slice) -> None:
        fast_cases(n[some], c[some], 2.0, 0.8, limit_cases(n[some], c[some])[0])

    run(slice(2))
    return timed(run, slice(None))[1] / cases


def rows(moments: tuple[float, ...]) -> list[Row]:
    """Measure everything once."""
    table = []
    for cycles in moments:
        truth = exact(PARABOLA, STICK, [cycles], 1e-5)[0].height(RADII)

        def measure(method: str, setting: str, repeats: int, run: Callable[[], Worn]) -> None:
            run()
            worn, seconds = timed(run, calls=repeats)
            error = float(np.max(np.abs(worn.height(RADII) - truth)))  # noqa: B023
            table.append(Row(method, setting, cycles, seconds, error))  # noqa: B023

        for xi in (0.8, 0.95):
            measure("fast", f"xi {xi}, one case with profile", 3, lambda xi=xi: fast(PARABOLA, STICK, cycles, xi))  # noqa: B023
        for accuracy in (3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4):
            measure(
                "exact",
                f"accuracy {accuracy:g}",
                3,
                lambda accuracy=accuracy: exact(PARABOLA, STICK, [cycles], accuracy, errors=False)[0],  # noqa: B023
            )
    return table


def draw(table: list[Row], path: str) -> None:
    """Draw error over time."""
    panels: dict[str, dict[str, Curve]] = {}
    for cycles in sorted({row.cycles for row in table}):
        panel = panels[f"parabola, c = {STICK:g}, N = {cycles:g}"] = {}
        for method in dict.fromkeys(row.method for row in table):
            points = [row for row in table if row.method == method and row.cycles == cycles]
            panel[method] = [row.seconds for row in points], [row.error for row in points]
    draw_errors(panels, "largest |Δf| / $d_0$", path)


def main() -> None:
    """Print the table, and ratios of times at an error of 1e-3."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figure")
    parser.add_argument("--cycles", type=float, nargs="+", default=[2.0, 8.0])
    options = parser.parse_args()
    moments = tuple(options.cycles)
    table = rows(moments)
    print_table(
        ("method", "setting", "N", "seconds", "error"),
        [(*row[:2], f"{row.cycles:g}", f"{row.seconds:.2e}", f"{row.error:.1e}") for row in table],
    )
    single = fast_seconds()
    print(f"fast, one of 20000 compiled cases: {single:.2e} s")
    for cycles in moments:
        reached = min(r.seconds for r in table if r.method == "exact" and r.cycles == cycles and r.error <= 1e-3)
        print(
            f"N = {cycles:g}, error 1e-3: exact {reached:.3g} s, the fast rule (its own equation solved to 2e-6) "
            f"{reached / single:.3g} times faster"
        )
    if options.figure:
        draw(table, options.figure)


if __name__ == "__main__":
    main()
