"""What is computed or loaded only once: equal cases, lines and tasks of a block, packages of a light command."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mdr_dask.execute import Resources, run
from mdr_dask.models import load
from mdr_dask.models.base import Block

LINE = {"length": 0.02, "points": 200, "rms_roughness": 5e-7, "shear_modulus": 1e7, "relaxation_time": 1e-3}
FACTOR = np.array([1.0, 2.0, 3.0, 10.0])
STICK, CYCLES = (grid.ravel() for grid in np.meshgrid([0.4, 0.6], [0.5, 1.0, 2.0, 4.0]))
#: Model, parameters, columns, an output, and the number of cases that differ in their dimensionless numbers.
EQUAL = {
    "sliding": (
        "sliding_friction",
        LINE | {"normal_force": 1.0, "velocity": 0.1},
        {
            "normal_force": FACTOR,
            "shear_modulus": 1e7 * FACTOR,
            "velocity": 0.1 / FACTOR,
            "relaxation_time": 1e-3 * FACTOR,
        },
        "friction_coefficient",
        1,
    ),
    "films": (
        "ehl_line",
        {"load_parameter": 1e-5, "speed_parameter": 1e-11, "material_parameter": 2500.0},
        {"slide_roll_ratio": np.array([0.0, 0.1, 0.2]), "eyring_stress": np.full(3, 5e6)},
        "central_film",
        1,
    ),
    "wear, exact": (
        "fretting_wear",
        {"stick_radius": 0.5, "wear_rule": "exact"},
        {"stick_radius": STICK, "cycles": CYCLES},
        "wear_volume",
        2,
    ),
}


@pytest.mark.parametrize("name", EQUAL)
def test_cases_of_equal_dimensionless_numbers_are_solved_once(name):
    model_name, numbers, columns, output, different = EQUAL[name]
    model = load(model_name)
    cases = len(next(iter(columns.values())))
    outputs = model.with_companions([output])
    result = model.compute(Block(model.parameters.model_validate(numbers), columns, cases, (0,), 3, outputs, 0.01))
    assert result.solves == different
    assert np.all(result.status == 1)


def test_a_block_is_one_task_and_one_file_of_every_array(toy, url):
    """Six blocks of two cases and three realisations; a second run computes nothing."""
    study = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]))
    progress = run(replace(study, blocks={"position": 2, "realisation": 3}), url, Resources(), lambda _: None)
    assert progress.blocks == 6
    assert len(toy.COMPUTED) == progress.solves == 36
    assert sum(path.is_file() for path in Path(url, "height", "c").rglob("*")) == 6
    assert run(study, url, Resources(), lambda _: None).blocks == 0
    assert len(toy.COMPUTED) == 36


@pytest.mark.parametrize("command", [["--help"], ["models", "sliding_friction"], ["schema", "-o", "schema.json"]])
def test_a_light_command_loads_no_heavy_package(command, tmp_path):
    code = (
        "import sys; from mdr_dask.cli import main; code = main(sys.argv[1:]); "
        "print(code, *({'dask', 'matplotlib', 'numba', 'pandas', 'scipy', 'xarray', 'zarr'} & set(sys.modules)))"
    )
    found = subprocess.run(
        [sys.executable, "-P", "-c", code, *command], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert found.stdout.splitlines()[-1] == "0"


def test_a_report_imports_no_kernels_and_no_drawing():
    """The laws and figures that every study may have."""
    code = (
        "import sys; from mdr_dask import fits, plots, report; "
        "fits.available('my:MODEL'); plots.available('my:MODEL'); "
        "print({'numba', 'scipy.stats', 'matplotlib.figure'} & set(sys.modules))"
    )
    found = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"
