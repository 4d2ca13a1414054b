"""Tables of every dialect and with every fault, read and told: on record."""

from __future__ import annotations

import numpy as np
import pandas as pd
import record
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.errors import DataError
from mdr_dask.fits import curve_tables
from mdr_dask.tables import Column, decoded, described, read_sheet, read_table

COLUMNS = (
    Column("frequency", "rad/s", ("f", "omega"), above=0.0),
    Column("modulus", "Pa", ("E'", "G"), least=0.2),
    Column("tan delta", "1", needed=False, least=0.0),
    Column("temperature", "K", ("T",), needed=False, above=0.0),
    Column("wave", "rad/m", ("q",), needed=False, given_unit="1/mm"),
)
TEXTS = {
    "plain": "frequency [rad/s],modulus [Pa]\n10.5,1.1e6\n20,2.2e6\n",
    "hertz, kilo": "f [kHz],G [MPa],T [C],q [1/um]\n0.1,3,20,2\n0.2,4,21.5,3\n",
    "rpm, degrees": "omega (rpm);E' (bar);T (°C);tan delta (-)\n30,5;7,2;-3;0,25\n60;8;0;1\n",
    "units in a row": "frequency\tmodulus\ttan delta\nrad/s\tkPa\t-\n1\t2\t3\n4\t5\t6\n",
    "units twice": "frequency [Hz],modulus [Pa]\nrad/s,MPa\n1,2\n3,4\n",
    "blanks": "frequency modulus\n rad/s   Pa \n  1  2,5 \n 3e-2   4 \n",
    "no names": "1,2\n3,4\n",
    "no names of three": "1;2;0,5\n3;4;0,1\n",
    "no names of six": "1,2,3,4,5,6\n3,4,5,6,7,8\n",
    "comments": "# from a rig\n% twice\n\nfrequency [rad/s],modulus [Pa]\n1,2\n# between\n3,4\n",
    "given unit": "f [rad/s],E' [Pa],q\n1,2,3\n4,5,6\n",
    "remark in brackets": "f [rad/s],E' (Pa),tan delta (of two)\n1,2,3\n4,5,6\n",
    "missing": "f [rad/s],E' [Pa],tan delta\n1,2,\n4,5,n/a\n",
    "names again": "f,E'\nf,E'\n1,2\n",
    "nothing": "# empty\n\n",
    "names alone": "f [rad/s],E' [Pa]\n",
    "uneven": "f [rad/s],E' [Pa]\n1,2\n3,4,5\n6\n1,5,2,5\n1,2\n",
    "words": "f [rad/s],E' [Pa]\n1,2\nmean,of all\n3,4\n",
    "no numbers": "f [rad/s],E' [Pa]\n1,2x\ny,4\n3,0x1\n",
    "below": "f [rad/s],E' [Pa],tan delta\n0,0.2,0\n-1,0.19,-0.1\n1e400,3,1\n",
    "below with a unit": "f [Hz],E' [kPa]\n0,1e-4\n2,2\n",
    "unknown": "f [rad/s],E' [Pa],temprature [K],zzz\n1,2,3,4\n",
    "twice": "f [rad/s],E' [Pa],G [Pa]\n1,2,3\n",
    "lacking": "tan delta,T [K]\n1,2\n",
    "lacking one": "f [rad/s],T [K]\n1,2\n",
    "no unit": "f,E' [Pa]\n1,2\n",
    "other dimension": "f [m],E' [parsec]\n1,2\n",
    "unknown unit": "f [rad/s],E' [blub]\n1,2\n",
    "quotes": 'f [rad/s],"E\' [Pa]"\n"1","2"\n',
    "many problems": "f [rad/s],E' [Pa]\n" + "".join(f"{k},a{k}\n" for k in range(14)),
    "wide": ",".join("1" * 1001) + "\n" + ",".join("2" * 1001) + "\n",
    "just wide": ",".join("1" * 1000) + "\n",
    "a quote open": "f [rad/s],E' [Pa]\n1,\"2\n",
}


def test_every_dialect_and_every_fault_is_read_as_it_was(dataframe_regression):
    found: dict[str, object] = {}
    for scene, text in TEXTS.items():
        for missing in (False, True)[: 1 + (scene == "missing")]:
            try:
                columns = read_table(text, "a.csv", COLUMNS, missing)
            except DataError as sentence:
                found[f"{scene} {missing}"] = str(sentence)
                continue
            found |= {f"{scene} {missing} {name}": values for name, values in columns.items()}
        try:
            found[f"{scene}: described"] = described(text, "a.csv")[:200]
            sheet = read_sheet(text, "a.csv", numeric=False)
            found[f"{scene}: cells"] = [
                f"{cell.text}@{cell.line}:{cell.column}" for row in sheet.rows[:2] for cell in row
            ][:6]
            found[f"{scene}: names"] = [f"{cell.text}@{cell.column}" for cell in sheet.names[:4]] + list(
                sheet.units[:4]
            )
        except DataError as sentence:
            found[f"{scene}: refused"] = str(sentence)
    for scene, content in {
        "latin": "T [°C]\n1".encode("cp1252"),
        "bytes": b"\xff\xfe1\x00",
        "mark": b"\xef\xbb\xbfa",
    }.items():
        try:
            found[scene] = decoded(content, "a.csv")
        except DataError as sentence:
            found[scene] = str(sentence)
    record.check(dataframe_regression, found)


CURVES = {
    "friction": "F_N [N],mu,v [mm/s]\n1,0.1,1\n2,0.2,1\n1,0.3,2\n3,0.2,2\n",
    "modulus": "freq,E_stor,T_C\nHz,MPa,C\n1,2,20\n2,3,20\n1,4,30\n2,5,30\n",
    "scattered": "load,cof,temp\n1,2,20.1\n2,3,19.8\n1,4,30.2\n2,5,29.9\n1,3,40.5\n2,3,39.6\n",
    "alone": "load,cof,v\n1,2,20\n2,3,20\n",
    "one load": "load,cof,v\n1,2,20\n1,3,30\n",
    "unknown": "a,b,c\n1,2,20\n1,3,30\n",
    "holes": "load,cof,v\n1,2,20\n2,,20\n1,nan,30\n2,4,30\n3,-,30\n",
    "negative": "load,cof,v\n1,-2,20\n2,3,20\n1,2,30\n",
    "two groups": "load,cof,v,T\n1,2,20,1\n2,3,20,2\n1,2,30,1\n",
    "loads beside": "t,modulus,T,load\n1,2,20,1\n2,3,30,2\n",
    "names twice": "a,a\n1,2\n",
    "no names": "1,2\n3,4\n",
}


def test_curves_of_tables_are_on_record(tmp_path, dataframe_regression):
    found: dict[str, object] = {}
    for scene, text in CURVES.items():
        path = tmp_path / "a.csv"
        path.write_text(text)
        try:
            frame = curve_tables.read_table(path)
            found[f"{scene}: units"] = [f"{name}={unit}" for name, unit in frame.attrs["units"].items()]
            over, values, by = used = curve_tables.columns_to_use(frame, None, None, None)
            found[f"{scene}: columns"] = [*used, str(curve_tables.is_temperature(by))]
            found[f"{scene}: second"] = str(curve_tables.second_group(frame, set(used)))
            kept, told = curve_tables.finite_rows(frame, list(used))
            found[f"{scene}: left out"] = [told, str(kept.attrs == frame.attrs)]
            centres, curves = curve_tables.curves_of(kept, over, values, by)
            found |= {f"{scene}: centres": centres, f"{scene}: curves": np.concatenate([np.ravel(c) for c in curves])}
        except DataError as sentence:
            found[f"{scene}: refused"] = str(sentence).replace(str(tmp_path), "")
    groups = {
        "near": [1, 1.02, 5, 5.01, 9.0, 9.3],
        "even": [1, 2, 3, 4.0],
        "one far": [1, 1.3, 1.6, 1.9, 5.0],
        "at the limit": [0, 1, 4.0, 5.0],
        "beyond the limit": [0, 1, 3.9, 4.9],
        "again": [1, 2, 1, 2, 3, 3, 3.0],
        "two": [1, 5.0],
    }
    found |= {f"{scene}: clusters": curve_tables.clusters(np.array(values)) for scene, values in groups.items()}
    given = pd.DataFrame({"load": [1.0, 2, 1, 2], "cof": [1.0, 2, 3, 4], "T": [1.0, 1, 2, 2], "v": [3.0, 3, 5, 5]})
    for asked in (("load", "cof", "T"), (None, None, "v"), ("force", None, None), (None, "zeta", None)):
        try:
            found[f"asked {asked}"] = list(curve_tables.columns_to_use(given, *asked))
        except DataError as sentence:
            found[f"asked {asked}"] = str(sentence)
    record.check(dataframe_regression, found)


def test_every_statistic_is_on_record(dataframe_regression):
    chance = np.random.default_rng(2)
    values = chance.standard_normal((3, 4, 7)) + np.arange(4)[:, None]
    values[0, 1, 2] = values[1, 2, 1:] = values[2, 3] = np.nan
    error = 0.1 * chance.standard_normal(values.shape)
    error[1, 1], error[0, 0, 3], error[2, 1, 2] = np.nan, np.nan, np.inf
    dims = ("a", "b", "realisation")
    data = xr.Dataset(
        {
            "y": (dims, values, {"units": "m", "ancillary_variables": "y_error", "long_name": "height"}),
            "y_error": (dims, error, {"units": "m"}),
            "z": (dims, chance.uniform(size=values.shape)),
            "fixed": (("a",), np.ones(3)),
            "status": (dims, np.ones(values.shape, dtype=int)),
        },
        {"a": [1.0, 2, 3], "realisation": np.arange(7), "p": 2.0},
        {"title": "of a study"},
    )
    found: dict[str, object] = {}
    for scene, part in {
        "all": data,
        "one line": data.isel(realisation=[3]),
        "lazy": data.chunk(a=1, realisation=3),
    }.items():
        reduced = aggregation.aggregate(part)
        found |= {f"{scene} {name}": array.values for name, array in reduced.data_vars.items()}
        if scene != "lazy":
            middle = aggregation.mean_and_ends(part.y, part.y_error), aggregation.mean_and_ends(part.z, None)
            found |= {f"{scene} mean and ends {k}": np.stack(ends) for k, ends in enumerate(middle)}
    told = reduced.data_vars.items()
    found["words"] = [f"{name}({', '.join(map(str, array.dims))}) {array.attrs}" for name, array in told]
    found["coordinates"] = [f"{name}={list(np.ravel(value))}" for name, value in reduced.coords.items()]
    for asked in ("mena", "mode"):
        try:
            aggregation.aggregate(data, (asked,))
        except DataError as sentence:
            found[asked] = str(sentence)
    found["companion"] = [str(aggregation.companion(data, name) is None) for name in ("y", "z")]
    record.check(dataframe_regression, found)
