"""Error of the fast rule of wear, relative to the exact rule, against stick radius and number of cycles.

python docs/examples/fast_rule.py results/fast_wear_error.zarr fast_rule.png
"""

import sys

import matplotlib.pyplot as plt

from mdr_dask import store as stores


def main(store: str, target: str = "fast_rule.png") -> None:
    """Draw the figure of a store into a file."""
    exact, fast = (stores.datasets(store)[name]["worn_profile"].isel(realisation=0) for name in ("exact", "fast"))
    difference = fast - exact.drop_vars("xi", errors="ignore")
    rms = (difference**2).mean(["radius", "stick_radius", "cycles"]) ** 0.5
    best = float(rms["xi"][int(rms.argmin("xi"))])
    largest = abs(difference).max("radius").sel(xi=best)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    largest.plot(ax=left, x="cycles", y="stick_radius", xscale="log", cbar_kwargs={"label": "largest |Δf| / d0"})
    left.set(title=f"xi = {best:.3g}", xlabel="cycles N / N0", ylabel="stick radius c / a0")
    right.plot(rms["xi"], rms, "o-")
    right.set(title="", xlabel="xi", ylabel="rms of Δf / d0")
    figure.savefig(target)


if __name__ == "__main__":
    main(*sys.argv[1:])
