"""What a study answers to questions, in rows, arrays and sentences: on record."""

from __future__ import annotations

import itertools
from contextlib import suppress

import numpy as np
import planted
import pytest
import record
import xarray as xr

import mdr_dask
from mdr_dask import studies
from mdr_dask.errors import DataError, MdrDaskError
from mdr_dask.models.base import Status
from mdr_dask.questions import progress, selection
from mdr_dask.questions.columns import Columns
from mdr_dask.questions.groups import averaged
from mdr_dask.questions.labelled import labelled
from mdr_dask.questions.table import Question, boxes, table

LINE = "  length: 20 mm\n  points: 500\n  rms_roughness: 0.37 um\n  shear_modulus: 9.1 MPa\n  relaxation_time: 1.3 ms\n"
SLIDING = "model: sliding_friction\nparameters:\n" + LINE
STUDIES = {
    "grid": f"{SLIDING}  hurst: [0.3, 0.74]\n  normal_force: [10 mN, 0.2 N, 7 N]\n"
    "  velocity: {geometric: [1 mm/s, 3000 mm/s, 8]}\n",
    "sampled": f"{SLIDING}  velocity: {{geometric: [1 mm/s, 1 m/s]}}\n  normal_force: {{linear: [9 mN, 3 N]}}\n"
    "sampling: {sobol: 9}\n",
    "wear": "model: fretting_wear\noutputs: [wear_volume, contact_radius, worn_profile]\nparameters:\n  points: 21\n"
    "  stick_radius: 0.5\n  cycles: [1, 2, 3, 4]\n  wear_rule: [fast, limit]\n",
}


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Studies with some results of each state, and with scatter of their own in every case."""
    found = {}
    chance = np.random.default_rng(4)
    for name, text in STUDIES.items():
        folder = tmp_path_factory.mktemp(name)
        data = planted.make(folder, text, realisations=3)[""].load()
        states = np.resize([1, 1, 1, 1, 2, 1, 1, 3, 1, 1, 0, 1, 1, 4, 1, 1, 1], data.status.size)
        states[6:9] = Status.NOT_NEEDED.value
        data["status"].values = states.reshape(data.status.shape)
        for key in [key for key in data if key != "status" and "realisation" in data[key].dims]:
            noise = 1 + 0.03 * chance.standard_normal(data[key].shape)
            data[key].values = (data[key] * noise).where(data.status == Status.DONE.value).transpose(*data[key].dims)
        found[name] = data
    return found


MU, F, V = "friction_coefficient", "normal_force", "velocity"
QUESTIONS: dict[str, list[dict[str, object]]] = {
    "grid": [
        {},
        {"outputs": (MU,), "statistics": None},
        {"outputs": (MU,), "statistics": ("mean", "quantile", "interval", "count", "standard_deviation", "grid_error")},
        {"columns": ("load_number", "velocity_number", "scaled_friction", "status", "realisations", V)},
        {"outputs": (MU,), "group_by": (F,)},
        {"outputs": (MU,), "group_by": (V, "hurst"), "where": "normal_force < 1 N", "sort": ("-" + MU,)},
        {"outputs": (MU,), "sort": ("hurst", "-normal_force", "velocity * 2")},
        {"outputs": (MU,), "sort": ("status", V)},
        {"outputs": (MU,), "where": f"{MU} > 0.5 % and velocity < 3 km/h or hurst == 0.74"},
        {"outputs": (MU,), "where": "not (hurst < 0.5) and normal_force in (10 mN, 7 N)"},
        {"outputs": (MU,), "where": "status == done", "statistics": None},
        {"outputs": (MU,), "selections": ("velocity=1 mm/s..0.2 m/s", "hurst=0.3,0.74", "normal_force=0.21 N")},
        {"outputs": (MU,), "selections": ("realisation=0,2", "velocity=..0.01")},
        {"outputs": (MU,), "units": {V: "km/h", F: "mN", MU: "%"}, "statistics": ("mean", "standard_error")},
        {"outputs": (MU,), "written": True},
        {"outputs": ("nothing",)},
        {"columns": ("nothing",)},
        {"where": "velocity + normal_force > 1"},
        {"where": "velocity"},
        {"where": "velocity > 1 N"},
        {"where": "velocity >"},
        {"sort": ("velosity",)},
        {"group_by": ("velosity",)},
        {"group_by": (V,), "statistics": None},
        {"units": {"velosity": "km/h"}},
        {"units": {V: "kg"}},
        {"selections": ("velocity=5 m/s",)},
        {"selections": ("velocity=1 mm",)},
        {"selections": ("velocity",)},
        {"selections": ("hurst=0.1",)},
        {"selections": ("normal_force=10 mN, 7",)},
        {"selections": ("velocity=1..2..3",)},
        {"selections": ("rough=1",)},
        {"selections": ("shear_modulus=9.1 MPa", "shear_modulus=8 MPa")},
        {"where": "friction_coefficient > 50"},
    ],
    "sampled": [
        {"outputs": (MU,)},
        {"outputs": (MU,), "selections": ("case=2..6",), "sort": ("-velocity",)},
        {"outputs": (MU,), "group_by": (F,), "where": "velocity > 3 mm/s"},
        {"outputs": (MU,), "selections": ("velocity=3 mm/s..0.3 m/s",), "statistics": None},
        {"columns": ("velocity_number", "case"), "outputs": (MU,)},
    ],
    "wear": [
        {"outputs": ("wear_volume",), "units": {"wear_volume": "um^3"}},
        {"outputs": ("wear_volume",), "where": "wear_rule == limit and cycles > 1"},
        {"outputs": ("wear_volume",), "where": "wear_rule != fast", "sort": ("-cycles",)},
        {"outputs": ("worn_profile",), "selections": ("wear_rule=Limit", "cycles=2")},
        {"outputs": ("wear_volume",), "selections": ("wear_rule=slow",)},
        {"outputs": ("wear_volume",), "sort": ("wear_rule", "-wear_volume")},
        {"outputs": ("wear_volume",), "where": "wear_rule == 3"},
        {"outputs": ("contact_radius",), "group_by": ("wear_rule",)},
    ],
}


@pytest.mark.parametrize("study", QUESTIONS)
def test_answers_in_rows_and_arrays_are_on_record(study, parts, dataframe_regression):
    found: dict[str, object] = {}
    for number, asked in enumerate(QUESTIONS[study]):
        told: list[str] = []
        try:
            limit = 5 if number % 4 == 1 else 0
            answer = table(parts[study], Question(**asked), limit, told.append)
            frames = list(answer.frames)
            units = [f"{name} [{unit}]" for name, unit in answer.units.items()]
            found[f"{number} first {limit}"] = [*units, str(answer.total), *(str(len(frame)) for frame in frames)]
            for name in (name for name in answer.units if frames and name not in ("hurst", F, "case")):
                column = np.concatenate([frame[name].to_numpy() for frame in frames])
                found[f"{number} {name}"] = column if column.dtype.kind in "fiub" else column[:9].astype(str)
        except DataError as sentence:
            found[f"{number} refused"] = str(sentence)
        found |= {f"{number} told": told[:3]} if told else {}
        with suppress(DataError):
            if number % 3:  # as many as are worth their time
                continue
            arrays = labelled(parts[study], Question(**asked), told.append)
            sizes = [f"{name}({dict(array.sizes)}) {array.attrs}" for name, array in arrays.data_vars.items()]
            found[f"{number} arrays"] = sizes
            numeric = [array.values.ravel() for array in arrays.data_vars.values() if array.dtype.kind in "fiu"]
            found |= {f"{number} values": np.concatenate([np.sign(all_) * np.abs(all_) ** 0.1 for all_ in numeric])}
    record.check(dataframe_regression, found)


FORMULAS = (
    "sqrt(velocity**2) + 1 km/h",
    "log10(velocity_number) - exp(-hurst)",
    "abs(-normal_force) / shear_modulus * 2",
    "-(velocity - 3 cm/s) / velocity",
    "2 / velocity",
    "velocity ** 0.5",
    "velocity ** hurst",
    "hurst ** velocity",
    "2 ** hurst * rms_roughness",
    "1e3 < normal_force * 1e4 <= 2e4",
    "0.3 < hurst < 0.8",
    "normal_force == 0.2000019",
    "normal_force == 0.200003",
    "normal_force not in (10 mN, 0.2)",
    "hurst in {0.3}",
    "velocity in hurst",
    "log(velocity)",
    "sqrt(velocity) > 1",
    "True",
    "velocity is 3",
    "velocity if hurst else 2",
    "velocity // 2",
    "velocity + 3 N",
    "status == 'done'",
    "status + 1",
    "hurst == status",
    "velosity > 3",
    "velocity > 3 blubs",
    "velocity = 3",
    "lambda: 3",
    "indenter.radius > 1 mm",
    "3 N > normal_force and 20 % < hurst",
    "1" * 501,
    "not velocity",
    "min(velocity)",
    "",
)


def test_formulas_are_on_record(parts, dataframe_regression):
    columns = Columns(parts["grid"])
    found: dict[str, object] = {}
    for text in FORMULAS:
        try:
            value = columns.evaluate(text)
        except DataError as sentence:
            found[text[:30]] = str(sentence)
            continue
        array = np.asarray(value.array)
        found[text] = array.astype(float) if array.dtype.kind in "fiub" else array.astype(str)
        found[f"{text}: dimension"] = str(value.dimension)
    for name in ("load_number", "indenter_radius", "scaled_frictio", "contact_radius"):
        try:
            array = columns.column(name)
            found[name] = [str(array.dims), str(array.attrs)]
        except DataError as sentence:
            found[name] = str(sentence)
    record.check(dataframe_regression, found)


def test_groups_boxes_and_parts_are_on_record(parts, dataframe_regression):
    data = parts["grid"]
    found: dict[str, object] = {}
    for by in (("velocity",), ("hurst", "normal_force"), ("normal_force", "hurst")):
        means = averaged(data[[MU, f"{MU}_error", "status"]], by, data.velocity < 1)
        found |= {f"{by} {name}": array.values for name, array in means.variables.items() if array.dtype.kind in "fiu"}
        found[f"{by} dims"] = [f"{name} {array.dims}" for name, array in means.variables.items()]
    none = averaged(data[[MU, f"{MU}_error", "status"]], ("hurst",), data.velocity < 0)
    found["of none"] = [f"{name} {array.shape}" for name, array in none.variables.items()]
    for sizes, most, chunks in itertools.product(((3, 4, 5), (7,), (2, 60)), (1, 6, 11, 59, 60, 1000), ((), (2, 3, 2))):
        cut = list(boxes(dict(zip("abc", sizes, strict=False)), most, chunks))
        ends = [end for box in cut for part in box.values() for end in (part.start, part.stop)]
        found[f"boxes {sizes} {most} {chunks}"] = np.array([len(cut), *ends], dtype=float)
    groups = {"one": data, "two": data.isel(hurst=0).drop_vars("hurst")}
    for text in ("hurst=0.3", "velocity=1 mm/s,3 m/s", "shear_modulus=9.1 MPa", "case=1"):
        try:
            kept = selection.select_all(groups, (text,))
            found[text] = [f"{key} {dict(part.sizes)}" for key, part in kept.items()]
        except DataError as sentence:
            found[text] = str(sentence)
    for condition in ("velocity > 1 m/s", "velocity > 1 km/s"):
        try:
            kept = selection.where_all(groups, condition)
            found[condition] = np.concatenate([part.status.values.ravel() for part in kept.values()])
        except DataError as sentence:
            found[condition] = str(sentence)
    for series in (None, "one", "three"):
        try:
            found[f"series {series}"] = str(selection.group(groups, series).sizes["hurst"])
        except DataError as sentence:
            found[f"series {series}"] = str(sentence)
    found["written"] = [selection.written(*each) for each in ((1.23456789, "m"), (2, "1"), ("w", "m"), (3.0, None))]
    told = [
        {"series": "", "status": "failed", "message": "no", "case": {"v": 1.23456789, "w": "a"}},
        {"series": "", "status": "done", "message": "so", "case": {"v": 3.0, "w": "a"}},
        {"series": "", "status": "failed", "message": "no", "case": {"v": 0.5, "w": "a"}},
        {"series": "s", "status": "not_converged", "message": "no", "case": {}},
    ]
    found["messages"] = [str(tuple(each)) for each in progress.grouped(told)]
    record.check(dataframe_regression, found)


def test_studies_from_python_are_on_record(tmp_path, parts, dataframe_regression):
    """Tables, fits and refusals as a notebook sees them."""
    data = parts["grid"]
    tree = xr.DataTree.from_dict({"/a": data, "/b": data.isel(hurst=[0])})
    found: dict[str, object] = {}
    steps = tmp_path / "steps.csv"
    rows = "".join(
        f"{k},{1 + 9 * (k > 5)},{0.6 + 0.01 * (k > 5) * np.exp(-(k - 6) / 3) + 4e-4 * np.sin(k * k):.6f}\n"
        for k in range(20)
    )
    steps.write_text(f"time [s],velocity [um/s],mu\n{rows}")
    curves = tmp_path / "curves.csv"
    curves.write_text(
        "F_N,mu,v\n"
        + "".join(
            f"{f},{0.1 * (f * v) ** 0.2 * (1 + 0.01 * np.sin(5 * f + v)):.6f},{v}\n"
            for v in (1, 2, 4)
            for f in (1, 2, 3, 5)
        )
    )
    calls = {
        "limit": lambda: mdr_dask.table(data, MU, limit=3),
        "no limit": lambda: mdr_dask.table(data, MU, statistics=None, select="velocity=1 mm/s"),
        "nothing left": lambda: mdr_dask.table(data, MU, where="velocity > 1 km/s"),
        "of a series": lambda: mdr_dask.table(tree, (MU,), series="b", sort="-velocity", limit=2),
        "no series": lambda: mdr_dask.table(tree, MU),
        "aggregate": lambda: mdr_dask.aggregate(data, "mean", columns=V, where="hurst < 0.5", group_by=(V,)),
        "numbers": lambda: data.mdr.numbers,
        "states": lambda: data.mdr.states.to_dataset(name="states"),
        "part": lambda: data.mdr.select("velocity=1 mm/s", "hurst=0.3").mdr.where("normal_force > 1"),
        "law": lambda: data.mdr.fit("plateau"),
        "laws": lambda: mdr_dask.fit(tree, "plateau")["b"].to_dataset(),
        "no law": lambda: mdr_dask.fit(data, "plato"),
        "steps": lambda: mdr_dask.fit(steps, "rate_and_state"),
        "no law of steps": lambda: mdr_dask.fit(str(steps), "plateau"),
        "curves": lambda: mdr_dask.master_curve(curves),
        "curves by force": lambda: mdr_dask.master_curve(str(curves), reference=2.0, vertical=True, bootstrap=5),
        "no study": lambda: mdr_dask.table(data[[MU]].isel(realisation=0), MU),
        "no model": lambda: mdr_dask.fit(data.drop_attrs(deep=False), "plateau"),
        "an output": lambda: mdr_dask.plot(data, MU),
        "no figure": lambda: mdr_dask.plot(data, "masterful_curve"),
        "no campaign": lambda: studies.check({"model": "sliding_frictoin"}),
    }
    for name, call in calls.items():
        try:
            answer = call()
        except MdrDaskError as sentence:
            found[name] = str(sentence).replace(str(tmp_path), "")
            continue
        found[f"{name}: columns"] = [*map(str, answer), str(getattr(answer, "attrs", {}).get("units"))]
        for column in list(answer)[:5]:
            values = np.asarray(answer[column]).ravel()
            found[f"{name} {column}"] = values if values.dtype.kind in "fiub" else values[:4].astype(str)
    record.check(dataframe_regression, found)
