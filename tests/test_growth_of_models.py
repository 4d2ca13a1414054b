"""Growth of a finished store for every model: what exists keeps its bytes, and only what is new is run."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from test_execute import digests, run

from mdr_dask import store
from mdr_dask.campaign import loads
from mdr_dask.errors import StoreError

LINE = """
parameters: {{length: 5 mm, points: 200, rms_roughness: 0.5 um, shear_modulus: 10 MPa, relaxation_time: 1 ms,
             normal_force: 1 N, velocity: {values}, hurst: {other}}}
"""
MODELS = {
    "sliding_friction": (LINE, "velocity", ("1 mm/s", "1 cm/s", "1 m/s"), "hurst", (0.7, 0.5)),
    "velocity_jump": (LINE, "velocity", ("1 mm/s", "1 cm/s", "10 cm/s"), "hurst", (0.7, 0.5)),
    "fretting_wear": (
        """
parameters: {{indenter: {{shape: parabola, radius: 10 mm}}, wear_rule: fast, contact_modulus: 115 GPa,
             effective_shear_modulus: 90 GPa, friction: 0.6, amplitude: 1 um, normal_force: 50 N, hardness: 2 GPa,
             wear_coefficient: 1e-4, cycles: {values}, wear_coefficient_scatter: {other}}}
outputs: [wear_volume, contact_radius]
""",
        "cycles",
        (1e3, 1e4, 1e5),
        "wear_coefficient_scatter",
        (0.5, 0.2),
    ),
    "mixed_lubrication": (
        """
parameters: {{normal_force: 200 N, rotation_speed: {values}, temperature: 60 degC, slide_roll_ratio: 0.02,
             rms_roughness: {other}, boundary_friction: 0.1, eyring_stress: 5 MPa}}
outputs: [breakthrough_probability, film]
""",
        "rotation_speed",
        ("10 rpm", "100 rpm", "1000 rpm"),
        "rms_roughness",
        ("0.2 um", "0.3 um"),
    ),
    "ehl_line": (
        """
parameters: {{load_parameter: 2e-5, speed_parameter: {values}, material_parameter: 2504, viscosity: {other},
             viscosity_law: barus}}
outputs: [central_film]
""",
        "speed_parameter",
        (1e-12, 3e-12, 1e-11),
        "viscosity",
        ("0.08 Pa s", "0.1 Pa s"),
    ),
}


def campaign(model, values, other, realisations, series=""):
    text = MODELS[model][0].format(values=str(list(values)).replace("'", ""), other=other)
    return loads(f"name: growing\nmodel: {model}\nseed: 3\nrealisations: {realisations}\n{text}{series}", "", Path())


@pytest.mark.parametrize("model", MODELS)
def test_values_in_between_realisations_and_series_extend_a_finished_store(model, tmp_path):
    url = str(tmp_path / "store.zarr")
    _, path, (low, middle, high), other, (first, second) = MODELS[model]
    assert run(campaign(model, (low, high), first, 2), url).done == 4
    before, early = digests(url), xr.open_zarr(url, chunks=None)
    kept = {name: store.datasets(url)[""][name].load() for name in store.datasets(url)[""].data_vars}

    changed = campaign(model, (low, high), second, 2)
    with pytest.raises(StoreError, match=f"{other}: .* in the store, .* in the campaign"):
        run(changed, url)
    assert digests(url) == before

    more = campaign(model, (low, middle, high), first, 3, f"\nseries: {{same: {{}}, changed: {{{other}: {second}}}}}")
    progress = run(more, url)
    assert (progress.done, progress.kept) == (18 - 4, 4)
    now = store.datasets(url)
    assert list(now) == ["-", "changed"]
    for name, values in kept.items():
        np.testing.assert_array_equal(now["-"][name].isel({path: [0, 2], "realisation": [0, 1]}), values)
        np.testing.assert_array_equal(early[name], values)
    once = str(tmp_path / "once.zarr")
    run(campaign(model, (low, middle, high), first, 3), once)
    for name in kept:
        np.testing.assert_array_equal(now["-"][name], store.datasets(once)[""][name])
