"""Figures 3.10 and 3.11: constants of fitted laws against the Hurst exponent, with 95 % intervals.

python docs/examples/constants.py results/friction_laws.zarr constants.png
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import mdr_dask

#: For each constant: the fit, and the law of the thesis with which the constant is compared.
CONSTANTS = {
    "alpha": ("zone_one", "H / (1 + H), eq. 3.13", lambda hurst: hurst / (1 + hurst)),
    "beta": ("zone_one", "1.6", lambda hurst: 1.6 + 0 * hurst),
    "plateau": ("plateau", "√2, eq. 3.15", lambda hurst: np.sqrt(2) + 0 * hurst),
}


def main(store: str, target: str = "constants.png") -> None:
    """Draw the figure of a store into a file."""
    figure, panels = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    for axes, (constant, (name, law, value)) in zip(panels, CONSTANTS.items(), strict=True):
        found = mdr_dask.fit(store, name)
        for result in [found] if isinstance(found, xr.Dataset) else [node.to_dataset() for node in found.leaves]:
            if constant in result and "hurst" in result.coords:
                middle, low, high = (result[constant + end].squeeze() for end in ("", "_low", "_high"))
                hurst = result["hurst"].broadcast_like(middle)
                lengths = [np.ravel(middle - low), np.ravel(high - middle)]
                axes.errorbar(np.ravel(hurst), np.ravel(middle), lengths, fmt="o", capsize=2)
        line = np.linspace(0, 1)
        axes.plot(line, value(line), "k-", label=law)
        axes.set(xlabel="Hurst exponent H", ylabel=constant, ylim=(0, None))
        axes.legend()
    figure.savefig(target)


if __name__ == "__main__":
    main(*sys.argv[1:])
