import numpy as np
import pandas as pd

from mdr_dask.fit.master_curve import master_curve
from mdr_dask.plots.master_curve import draw_master_curve


def test_three_panels_with_units_bars_and_extrapolated_range(tmp_path):
    force, velocity = (a.ravel() for a in np.meshgrid(np.geomspace(1, 100, 12), [1e-3, 1e-2, 1e-1]))
    frame = pd.DataFrame({"force": force, "velocity": velocity, "mu": 1 / (1 + force * velocity**-0.15)})
    frame.attrs["units"] = {"force": "N", "velocity": "m/s"}
    figure = draw_master_curve(master_curve(frame))
    measured, merged, factors = figure.axes
    assert measured.get_xlabel() == "force (N)"
    assert len(measured.lines) == 3
    np.testing.assert_allclose(np.sort(measured.lines[0].get_xdata()), np.geomspace(1, 100, 12))
    solid = merged.lines[-1].get_xdata()
    assert np.isnan(solid).any()
    assert np.nanmin(solid) >= 0.99
    assert factors.get_xscale() == "log"
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1e4
