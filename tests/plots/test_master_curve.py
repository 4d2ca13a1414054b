import numpy as np
import pandas as pd

from mdr_dask.fits.master_curve import master_curve
from mdr_dask.plots.master_curve import draw_master_curve


def test_three_panels_with_units_bars_and_extrapolated_range(tmp_path):
    force, velocity = (a.ravel() for a in np.meshgrid(np.geomspace(1, 100, 12), [1e-3, 1e-2, 1e-1]))
    frame = pd.DataFrame({"force": force, "velocity": velocity, "mu": 1 / (1 + force * velocity**-0.15)})
    frame.attrs["units"] = {"force": "N", "velocity": "m/s"}
    figure = draw_master_curve(master_curve(frame))
    measured, merged, factors = figure.axes
    assert measured.get_xlabel() == "force [N]"
    assert len(measured.lines) == 3
    np.testing.assert_allclose(np.sort(measured.lines[0].get_xdata()), np.geomspace(1, 100, 12))
    (solid,) = (line for line in merged.lines if line.get_label() == "measured at the reference")
    (whole,) = (line for line in merged.lines if line.get_label() == "reached by shifting")
    inside = np.isfinite(solid.get_ydata())
    np.testing.assert_array_equal(solid.get_ydata()[inside], whole.get_ydata()[inside])
    np.testing.assert_allclose(whole.get_ydata(), 1 / (1 + whole.get_xdata() * 1e-2**-0.15), rtol=0.02)
    solid = np.where(inside, solid.get_xdata(), np.nan)
    assert np.isnan(solid).any()
    assert np.nanmin(solid) >= 0.99
    assert factors.get_xscale() == "log"
    assert (
        {axes.get_xscale() for axes in (measured, merged)}
        == {axes.get_yscale() for axes in (measured, merged)}
        == {"log"}
    )
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1e4


def test_curves_that_do_not_collapse_are_called_so():
    force, velocity = (a.ravel() for a in np.meshgrid(np.geomspace(1, 100, 12), [1e-3, 1e-2, 1e-1]))
    bent = 1 / (1 + (force * velocity**-0.15) ** (0.6 + 10 * velocity))
    frame = pd.DataFrame({"force": force, "velocity": velocity, "mu": bent})
    frame.attrs["units"] = {"force": "N", "velocity": "m/s"}
    assert "the curves do NOT collapse" in draw_master_curve(master_curve(frame)).get_suptitle()
    smooth = frame.assign(mu=1 / (1 + force * velocity**-0.15))
    title = draw_master_curve(master_curve(smooth)).get_suptitle()
    assert "do NOT collapse" not in title
    assert "reference: velocity = 0.01 m/s" in title
