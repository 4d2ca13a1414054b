"""Eq. 3.23: friction at all loads is one curve, if the velocity is divided by a crossover velocity.

python docs/examples/collapse.py results/friction_force.zarr collapse.png
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

from mdr_dask import store as stores
from mdr_dask.aggregation import mean
from mdr_dask.physics.sliding import laws


def main(store: str, target: str = "collapse.png") -> None:
    """Draw the figure of a store into a file."""
    figure, axes = plt.subplots(layout="constrained")
    for name, data in stores.datasets(store).items():
        slope = mean(data["rms_slope"])
        force = laws.force_number(data["normal_force"], data["shear_modulus"], data["rms_roughness"], data["length"])
        speed = laws.velocity_number(data["velocity"], data["relaxation_time"], slope, data["rms_roughness"])
        x = speed / laws.crossover(force, laws.alpha(data["hurst"]), laws.BETA)
        y = mean(data["friction_coefficient"]) / (np.sqrt(2) * slope)
        x, y, colour = (np.ravel(each.transpose(*y.dims)) for each in (x.broadcast_like(y), y, force.broadcast_like(y)))
        points = axes.scatter(x, y, s=8, c=np.log10(colour), label=name or None)
    line = np.geomspace(np.nanmin(x), np.nanmax(x), 200)
    axes.plot(line, line / np.sqrt(1 + line**2), "k-", label="law, eq. 3.18")
    axes.set(xscale="log", yscale="log", xlabel="velocity number over crossover", ylabel="μ / (√2 rms slope)")
    figure.colorbar(points, label="log10 of the force number F / (G h L)")
    axes.legend()
    figure.savefig(target)


if __name__ == "__main__":
    main(*sys.argv[1:])
