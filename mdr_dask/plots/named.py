"""The figures that have a name. One or several views (`mdr_dask.plots.view.View`) describe each figure."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import Figure
from mdr_dask.plots.view import View, draw


def described(name: str, model: str, summary: str, *views: View, otherwise: View | None = None) -> Plot:
    """Return a named figure with the views one above the other, or the view `otherwise` if a store lacks their data."""

    def either(groups: Mapping[str, xr.Dataset]) -> Figure:
        try:
            return draw(groups, *views)
        except DataError:
            if otherwise is None:
                raise
            return draw(groups, otherwise)

    return Plot(name, (model,), summary, either)


SLIDING, JUMP, MIXED, EHL, WEAR = (
    *("sliding_friction", "velocity_jump", "mixed_lubrication", "ehl_line", "fretting_wear"),
)
#: Limits of the film ratio: below 0.5, a computed breakthrough is an artefact; 1 and 3 separate lubrication regimes.
FILM_RATIOS = {
    0.5: "film ratio 0.5: below it breakthrough is an artefact",
    1.0: "film ratio 1: boundary below, mixed above",
    3.0: "film ratio 3: full film above",
}
STRIBECK = ("friction_coefficient", "asperity_load_share", "contact_length", "breakthrough_probability")

PLOTS: tuple[Plot, ...] = (
    described(
        *("velocity", SLIDING, "coefficient of friction against velocity, with its law"),
        View("friction_coefficient", "velocity", log="x"),
    ),
    described(
        *("force", SLIDING, "coefficient of friction against normal force"),
        View("friction_coefficient", "normal_force"),
    ),
    described(
        *("contact_growth", SLIDING, "length and rms slope in contact against normal force"),
        View(("contact_fraction", "contact_slope"), "normal_force"),
    ),
    described(
        *("stribeck", MIXED, "friction, load share, contact, breakthrough and film ratio against speed"),
        View(STRIBECK, "rotation_speed", log="x"),
        View("film_ratio", "rotation_speed", guides={"film_ratio": FILM_RATIOS}),
    ),
    described(
        *("temperature", MIXED, "breakthrough probability against temperature, by load and speed"),
        View("breakthrough_probability", "temperature", "normal_force", "rotation_speed", log=""),
        otherwise=View("breakthrough_probability", "temperature", log=""),
    ),
    described(
        *("profiles", MIXED, "the two surfaces in the contact where contact is greatest"),
        View(("upper_profile", "lower_profile"), "position", single=True),
    ),
    described(
        *("trace", MIXED, "contact length during one revolution, one panel for each case"),
        View("contact_length_trace", "angle", log="", single=True, apart=True),
    ),
    described(
        *("film_profile", EHL, "pressure and film thickness against position"),
        View(("pressure", "film"), "position", log="y"),
    ),
    described(
        *("starvation", EHL, "central and minimum film thickness against the position of the inlet"),
        View(("central_film", "minimum_film"), "inlet", log=""),
    ),
    described(
        *("traction", EHL, "traction coefficient against slide-roll ratio"),
        View("traction_coefficient", "slide_roll_ratio"),
    ),
    described(
        *("wear_profiles", WEAR, "worn profile and its one-dimensional image, for growing numbers of cycles"),
        View("worn_profile", "radius", log=""),
        View("worn_image", "position", log=""),
    ),
    described(
        *("wear_growth", WEAR, "worn volume against cycles or sliding path"),
        View("wear_volume", "cycles"),
        otherwise=View("wear_volume", "path"),
    ),
)
