"""Map of the regimes of a lubricated line contact over Moes' numbers M and L, with the cases of a store.

python docs/examples/film_regimes.py results/ehl_map.zarr film_regimes.png
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

from mdr_dask import store as stores
from mdr_dask.models.ehl_line import groups
from mdr_dask.physics.lubrication.film_formulas import limiting_films, moes_parameters

REGIMES = ("rigid isoviscous", "rigid piezoviscous", "elastic isoviscous", "elastic piezoviscous")


def main(store: str, target: str = "film_regimes.png") -> None:
    """Draw the figure of a store into a file."""
    figure, axes = plt.subplots(layout="constrained")
    M, L = np.geomspace(0.1, 1e3, 300), np.geomspace(0.1, 100, 300)
    films = limiting_films(M, 0.5, L[:, None])  # with 2 U = 1, M is W and L is G
    # elastic flattening makes an isoviscous film thicker and a piezoviscous film thinner
    isoviscous, piezoviscous = np.maximum(films[0], films[2]), np.minimum(films[1], films[3])
    film = np.maximum(isoviscous, piezoviscous)
    field = np.argmax(films == film, axis=0)
    axes.pcolormesh(M, L, field, cmap="Pastel1", vmin=0, vmax=8, shading="nearest", rasterized=True)
    for k, name in enumerate(REGIMES):
        rows, columns = np.nonzero(field == k)
        if rows.size:
            axes.text(M[int(np.median(columns))], L[int(np.median(rows))], name, ha="center", weight="bold")
    for name, data in stores.datasets(store).items():
        W, U, G, _ = xr.broadcast(*groups(data.coords.get), data["minimum_film"].isel(realisation=0))
        numbers = moes_parameters(W, U, G)
        axes.plot(np.ravel(numbers.M), np.ravel(numbers.L), ".", label=name or "cases")
    axes.set(xscale="log", yscale="log", xlabel="load M = W / √(2U)", ylabel="lubricant L = G (2U)^(1/4)")
    axes.legend(loc="upper left")
    figure.savefig(target)


if __name__ == "__main__":
    main(*sys.argv[1:])
