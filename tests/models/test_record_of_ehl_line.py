"""Whole blocks of lubricated line contacts on record: every output with its error, at two accuracies."""

import numpy as np
import record
from flattened import flat, of_result

from mdr_dask.models import load
from mdr_dask.models.base import Block
from mdr_dask.models.ehl_line.declaration import distinct, memory, seconds

MODEL = load("ehl_line")
ALL = tuple(output.name for output in MODEL.outputs)
FILMS = ALL[:4]
NUMBERS = {"load_parameter": 4.1e-5, "speed_parameter": 2.3e-11, "material_parameter": 3907.0, "profile_points": 23}
UNITS = {"line_load": 1.3e5, "mean_velocity": 0.7, "pressure_viscosity": 1.9e-8, "radius": 0.017, "viscosity": 0.13}


def block(outputs=ALL, columns=None, accuracy=None, **given):
    columns = {name: np.asarray(values) for name, values in (columns or {}).items()}
    cases = len(next(iter(columns.values()))) if columns else 1
    return Block(MODEL.parameters(**given), columns, cases, (0, 1), 1, MODEL.with_companions(outputs), accuracy)


def test_contacts(dataframe_regression):
    sheared = {"slide_roll_ratio": 0.03, "shear_law": "eyring", "eyring_stress": 7e6}
    scenes = {
        "numbers": block(**NUMBERS),
        "coarse": block(ALL, None, 0.01, **NUMBERS),
        "units": block(profile_points=31, profile_start=-2.1, profile_end=1.3, **UNITS, **sheared),
        "roelands": block(viscosity_law="roelands", contact_modulus=9e10, compressible=False, **UNITS, **sheared),
        "inlet": block(FILMS, {"inlet": [-1.2, -2.5, -9.0]}, **UNITS),
        "loads": block(ALL, {"load_parameter": [3e-9, 2e-6, 3e-4, 0.01]}, 3e-3, **NUMBERS | {"slide_roll_ratio": 0.01}),
        "shared": block(FILMS, {"slide_roll_ratio": [0.0, 0.1], "radius": [0.02, 0.02]}, **UNITS),
        "strict": block(
            ("spike_pressure", "film", "traction_coefficient"), None, 1e-5, slide_roll_ratio=0.02, **NUMBERS
        ),
        "none": block(FILMS[:1], **NUMBERS | {"load_parameter": 0.9, "speed_parameter": 1e-19}),
    }
    results = {name: MODEL.compute(one) for name, one in scenes.items()}
    for result in results.values():
        if "load_error" in result.values:  # rounding, which other tests before this one change
            result.values["load_error"] = np.round(result.values["load_error"], 12)
    found = {name: of_result(result) for name, result in results.items()}
    found |= {"seconds": np.array([seconds(one) for one in scenes.values()])}
    found |= {"distinct": [str(distinct(one)) for one in scenes.values()]}
    found |= {"coordinates": MODEL.coordinates(scenes["units"].parameters)}
    found |= {"memory": memory(scenes["none"])}
    record.check(dataframe_regression, flat("", found))
