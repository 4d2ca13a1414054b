"""The figures that have a name. One or several views (`mdr_dask.plots.view.View`) describe each figure."""

from __future__ import annotations

from mdr_dask.plots.base import Plot
from mdr_dask.plots.view import View, draw

#: Limits of the film ratio: below 0.5, a computed breakthrough is an artefact; above 3, the film separates the rollers.
FILM_RATIOS = {
    0.5: "film ratio 0.5: breakthroughs below it are artefacts",
    3.0: "film ratio 3: full film above",
}
STRIBECK = ("friction_coefficient", "asperity_load_share", "contact_length", "breakthrough_probability")
#: For each model, the figures by name. A figure has a summary and views (see `mdr_dask.plots.view.draw`).
FIGURES: dict[str, dict[str, tuple[str, *tuple[View, ...]]]] = {
    "sliding_friction": {
        "velocity": (
            "coefficient of friction against velocity, with its law",
            View("friction_coefficient", "velocity", log="x"),
        ),
        "force": (
            "coefficient of friction against normal force",
            View("friction_coefficient", "normal_force", log="xy"),
        ),
        "contact_growth": (
            "length and rms slope in contact against normal force",
            View(("contact_fraction", "contact_slope"), "normal_force", log="xy"),
        ),
    },
    "mixed_lubrication": {
        "stribeck": (
            "friction, load share, contact, breakthrough and film ratio against speed",
            View(STRIBECK, "rotation_speed", log="x"),
            View("film_ratio", "rotation_speed", log="xy", guides={"film_ratio": FILM_RATIOS}),
        ),
        "temperature": (
            "breakthrough probability against temperature",
            View("breakthrough_probability", "temperature", log=""),
        ),
        "profiles": (
            "profiles of the two rollers at the angle with the longest intimate contact",
            View(("upper_profile", "lower_profile"), "position", single=True),
        ),
        "trace": (
            "contact length during one revolution",
            View("contact_length_trace", "angle", log="", single=True),
        ),
    },
    "ehl_line": {
        "film_profile": (
            "pressure and film thickness against position",
            View(("pressure", "film"), "position", log="y"),
        ),
        "starvation": (
            "central and minimum film thickness against the position of the inlet",
            View(("central_film", "minimum_film"), "inlet", log=""),
        ),
        "traction": (
            "traction coefficient against slide-roll ratio",
            View("traction_coefficient", "slide_roll_ratio"),
        ),
    },
    "fretting_wear": {
        "wear_profiles": (
            "worn profile and its one-dimensional image, for growing numbers of cycles",
            View("worn_profile", "radius", log=""),
            View("worn_image", "position", log=""),
        ),
        "wear_growth": (
            "worn volume against cycles or sliding path",
            View("wear_volume", "cycles"),
            View("wear_volume", "path"),
        ),
    },
}


def _plot(model: str, name: str, summary: str, *views: View) -> Plot:
    return Plot(name, (model,), summary, lambda groups: draw(groups, *views))


PLOTS = tuple(_plot(model, name, *how) for model, figures in FIGURES.items() for name, how in figures.items())
