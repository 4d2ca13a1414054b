"""Record of what is made of campaigns and said of them: pages, drafts, axes, messages, notes, units."""

import json
from pathlib import Path

import numpy as np
import record

from mdr_dask import api, errors, headings, models, units
from mdr_dask.campaign import (
    cluster,
    document,
    draft,
    keys,
    loads,
    measured,
    problems,
    reference,
    sampling,
    schema,
    variation,
    written,
)
from mdr_dask.campaign.definition import Spread
from mdr_dask.errors import MdrDaskError

DOCS = Path(__file__).parents[2] / "docs"
REAL = ("sliding_friction", "mixed_lubrication")


def said(act, *given):
    """Return what comes of an act, or why nothing does."""
    try:
        return act(*given)
    except (MdrDaskError, ValueError) as error:
        return f"{type(error).__name__}: {error}".splitlines()


def test_pages_and_schema_are_those_of_the_docs(monkeypatch):
    monkeypatch.undo()
    assert reference.reference_page() == (DOCS / "campaign-file.md").read_text()
    assert schema.json_schema() == json.loads((DOCS / "campaign.schema.json").read_text())
    assert api.api_page() == (DOCS / "api.md").read_text()


def test_record_of_drafts(rubbing, monkeypatch, dataframe_regression):
    found = {"rubbing": draft.draft("my.module:Rubbing", rubbing, "a.yaml").splitlines()}
    found |= {"parts of rubbing": json.dumps(schema.parameters_schema(rubbing.parameters))}
    found |= {"rows": [json.dumps(row, ensure_ascii=False) for row in reference.parameter_rows(rubbing)]}
    found |= {"outputs": [json.dumps(row) for row in reference.output_rows(rubbing)]}
    monkeypatch.undo()
    for name in REAL:
        found[name] = draft.draft(name, models.load(name), "first.yaml").splitlines()
    record.check(dataframe_regression, found)


HEAD = "name: a\nmodel: rubbing\nparameters:\n  length: 20 mm\n"
FORCE = "  normal_force: 1 N\n"
RANGES = "  normal_force: {geometric: [2 N, 0.7 kN]}\n  points: {linear: [7, 311]}\n  hurst: {linear: [0.1, 0.83]}\n"
ADAPTIVE = "  normal_force: {adaptive: [1 N, %s], until: %s, at_most: 21}\n"
TEXTS = {
    "plain": FORCE,
    "drawn by sobol": RANGES + "sampling: {sobol: 5}\nseed: 3\n",
    "drawn by a hypercube": RANGES + "sampling: {latin_hypercube: 6}\nseed: 4\n",
    "drawn by saltelli": RANGES + "sampling: {saltelli: 3}\nseed: 5\n",
    "drawn, one is a list": RANGES + "  depth: [1 mm, 2 mm]\nsampling: {sobol: 5}\n",
    "drawn, with a count": RANGES.replace("311", "311, 4") + "sampling: {sobol: 5}\n",
    "drawn, none varies": FORCE + "sampling: {sobol: 5}\n",
    "drawn and adaptive": ADAPTIVE % ("9 N", "1 %") + "sampling: {sobol: 5}\n",
    "zip": "  normal_force: [1, 2, 3]\n  velocity: {geometric: [1, 7, 3]}\nsampling: zip\n",
    "zip of unequal lengths": "  normal_force: [1, 2, 3]\n  velocity: [1, 2]\n  points: [3, 4, 5, 6]\nsampling: zip\n",
    "zip and adaptive": "  velocity: [1, 2]\n" + ADAPTIVE % ("9 N", "1 %") + "sampling: zip\n",
    "adaptive": ADAPTIVE % ("9 N", "1 %"),
    "adaptive over decades": ADAPTIVE % ("10.1 N", "{indentation_depth: {absolute: 2 um}, friction_coefficient: 2 %}"),
    "adaptive over a decade": ADAPTIVE % ("10 N", "0.02"),
    "adaptive downwards": ADAPTIVE.replace("1 N, %s", "2 kN, %s") % ("3 N", "0.03"),
    "adaptive of whole numbers": FORCE + "  points: {adaptive: [5, 900], until: 3 %}\n",
    "adaptive of few whole numbers": FORCE + "  points: {adaptive: [5, 6], until: 3 %}\n",
    "adaptive by none": ADAPTIVE % ("9 N", "0"),
    "adaptive by what is none": ADAPTIVE % ("9 N", "{friction: 1 %, pressure: 1 %}") + "outputs: [pressure]\n",
    "adaptive by a length": ADAPTIVE % ("9 N", "{indentation_depth: 1 s}"),
    "adaptive without numbers": ADAPTIVE % ("9 N", "1 %") + "outputs: [pressure]\n",
    "adaptive from three": FORCE + "  velocity: {adaptive: [1, 2, 3], until: 1 %}\n",
    "adaptive from words": FORCE + "  velocity: {adaptive: [true, 2], until: 1 %}\n",
    "adaptive without until": FORCE + "  velocity: {adaptive: [1, 2], at_most: 4}\n",
    "three adaptive": "".join(
        f"  {name}: {{adaptive: [1, 2], until: 1 %}}\n" for name in ("normal_force", "velocity", "depth")
    ),
    "structures": FORCE + "  indenter: [{shape: cone, angle: 5 deg}, {shape: power, exponent: 2, radius: 3 mm}]\n",
    "inside structures": FORCE
    + "  indenter: {shape: power, exponent: [2, 4], radius: {geometric: [1 mm, 3 mm, 3]}}\n  depth: [~, 2 mm]\n",
    "lists of lists": FORCE + "  moduli: [[1 MPa], [1 MPa, 2 MPa]]\n  shift: [true, false]\n",
    "a value twice": "  normal_force: [1 N, 2 N, 1000 mN]\n  scheme: [exact, euler, exact]\n",
    "ends that do not fit": FORCE + "  velocity: {linear: [0.5 km/s, 2 km/s, 4]}\n",
    "infinite ends": FORCE + "  velocity: {linear: [.inf, 1, 3]}\n  depth: {linear: [~, 1, 3]}\n",
    "counts": FORCE + "  velocity: {linear: [1, 2, '3']}\n",
    "a count of one": FORCE + "  velocity: {linear: [1, 2, 1]}\n",
    "a count of a million": FORCE + "  velocity: {linear: [1, 2, 1000001]}\n  depth: {linear: [1, 2, true]}\n",
    "values that are none": FORCE + "  velocity: {values: 3}\n  depth: {values: []}\n",
    "series": FORCE + "series:\n  one: {hurst: [0.1, 0.9]}\n  two: {normal_force: 3, points: 7}\n",
    "blocks": "  normal_force: [1, 2]\nstore: {path: x.zarr, blocks: {normal_force: 2, realisation: 3, velocit: 1}}\n",
    "rounds": FORCE
    + "realisations: {at_least: 4, at_most: 9, until: {friction_coefficient: 1 %, indentation_depth: {absolute: 2 um, "
    "relative: 3 %}, plateau: 2 %, zone_one.alpha: 0.01, wide.beta: {absolute: 0.2, relative: 4 %}}}\n",
    "rounds that are wrong": FORCE
    + "realisations: {at_least: 9, at_most: 8, until: {friction_coeficient: 1 %, indentation_depth: {absolute: -1}, "
    "plateau: 0, zone_one.alpha: x, pressure: 1 %}}\n",
    "outputs": FORCE + "outputs: [pressure, indentation_depth]\nerrors: false\naccuracy: 2 %\nseed: 7\n",
    "outputs that are wrong": FORCE + "outputs: [pressures, pressure, pressure]\naccuracy: 1\nseed: -1\n",
    "numbers far off": "  normal_force: [1, 2]\n  indenter: {shape: power, exponent: 1e9, radius: 1e5}\n",
    "a long name": FORCE + f"series: {{{'x' * 100}: {{}}, {'y' * 101}: {{}}}}\n",
    "names": FORCE + "series: {a b: {}, a.: {}, .b: {}, a.json: {}, a.partial: {}, -: {}, a-b_c.d: {}}\n",
    "words for structures": "  normal_force: cone\n  indenter: sphere\n  profile: 3\n  moduli: 1 MPa\n",
    "a finish that smooths": FORCE + "  finish: wavelength\n  oversampling: Auto\n  points: 7.0\n",
    "a finish of a mapping": FORCE + "  finish: {wavelength: -1}\n  hurst: 70\n  shift: 1\n",
    "a finish of another": FORCE + "  finish: {wavelenth: 1 mm}\n  oversampling: {linear: [1, 2]}\n",
    "a finish by its name": FORCE + "  finish: line.txt\n  temperature: 20\n  depth: 1,5 mm\n",
    "a trace": FORCE + "  finish: {trace: nowhere.txt}\n  wavelength: 1 mm\n  angle: 3\n",
    "bounds": "  normal_force: -1\n  hurst: 1.5\n  points: 1\n  moduli: []\n  oversampling: 0\n",
    "a table": FORCE + "sampling: {table: cases.csv}\n",
    "a table and an axis": "  normal_force: [1, 2]\nsampling: {table: cases.csv}\n",
    "a table of others": FORCE + "sampling: {table: others.csv}\n",
    "a table of no headings": FORCE + "sampling: {table: none.csv}\n",
    "a table of numbers": FORCE + "sampling: {table: numbers.csv}\n",
    "a table that is a folder": FORCE + "sampling: {table: .}\n",
    "no sampling": FORCE + "sampling: random\nrealisations: 0\nstore: {blocks: {realisation: 0}}\n",
}
FILES = {
    "cases.csv": "velocity [mm/s],indenter.shape,indenter.angle [deg],points,shift\n"
    "3,cone,5,7,true\n4,cone,6,8,false\n",
    "others.csv": "velocity,hurst [mm],normal_force,depth.x,indenter.angle,velocity\n1,2,3,4,5,6\n",
    "none.csv": "\n1,2\n",
    "numbers.csv": "1,2\n1,2\n",
}


def told(found):
    """Return all that a campaign holds, and what it asks."""
    rest = (found.name, found.seed, found.outputs, found.accuracy, found.store, found.blocks, found.replication)
    lines = [repr(rest), *found.remarks]
    for series in found.series:
        lines += [f"{series.name}: {series.sizes} {series.parameters!r}"]
        lines += [f"{series.name}: {axis!r}" for axis in series.axes]
    return lines


def test_record_of_campaigns(tmp_path, dataframe_regression):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    found = {
        name: [
            line.replace(str(tmp_path), "HERE")
            for line in said(lambda text: told(loads(HEAD + text, "a.yaml", str(tmp_path))), text)
        ]
        for name, text in TEXTS.items()
    }
    record.check(dataframe_regression, found)


QUANTITIES = (
    "20 mm",
    "3",
    "-2e3 um",
    ".5 %",
    "1,5 mm",
    "1,000 mm",
    "1, 2 mm",
    "1 to 2 mm",
    "1 kg",
    "3 C",
    "3 F",
    "2 mm3",
)
QUANTITIES += (
    "1e400 m",
    "5 Mpa",
    "7 mbar",
    "3 degC",
    "30 deg",
    "1 m^100",
    "1 " + "m" * 61,
    "x" * 61,
    "4 %%",
    "2 /s",
    "",
)
SI = ("m", "1", "Pa", "K", "rad", "N", "1/s", "Pa*s", "m^(1-n)", "kg K")
VALUES = (0.0, 1.0, -1e-4, 5e-4, 0.9996, 999.96, 253.15, 273.15, 1.5e7, 3e-13, 4e15, float("inf"), 7)


def test_record_of_units(dataframe_regression):
    found = {f"{text[:9]} as {unit}": str(said(units.to_si, text, unit)) for text in QUANTITIES for unit in SI[:3]}
    found |= {f"{unit}: shown": [units.shown(value, unit) for value in VALUES] for unit in SI}
    found |= {f"{unit}: in few digits": [units.shown(value, unit, 2) for value in VALUES] for unit in SI[:5]}
    pairs = (("m", "um"), ("K", "degC"), ("rad", "deg"), ("1", "%"))
    found |= {f"{unit} in {other}": [units.shown(v, unit, 5, other) for v in VALUES] for unit, other in pairs}
    found |= {f"{unit}: said": [units.expected(unit), units.example_unit(unit)] for unit in (*units._MEANINGS, *SI)}
    found |= {f"{text[:9]}: spelt": [units.spelt(text), units.unit_behind(text)] for text in QUANTITIES}
    usual = {"m": "20 mm", "Pa": "10 MPa", "K": "300 K", "N": "1 mN", "s": "1 ms", "1/Pa": "20 1/GPa", "J": "1 mJ"}
    numbers = (0.0, 20.0, 25.0, 19.9, 150.0, 151.0, 3e-6, 601.0, 1e9, 1e308)
    for unit, common in usual.items():
        found[f"{unit}: far"] = [units.is_far(value, unit, common) for value in numbers]
        found[f"{unit}: likely"] = [units.likely(value, unit, common) for value in numbers if value]
    found["seconds"] = [units.seconds(t) for t in (0.0123, 9.94, 9.99, 10, 59.6, 60, 61.4, 599.6, 600, 3599.6, 7265)]
    wanted = (("mm", "m"), ("degC", "K"), ("rpm", "rad/s"), ("kg", "N"), ("furlong", "m"), ("s", "m"), ("m^", "m"))
    found["conversion"] = [str(said(units.conversion, *pair)) for pair in wanted]
    found["dimension"] = [str(said(units.dimension_of, unit)) for unit in ("", "1", "N/mm", "deg", "eV", "ell", "%")]
    for name in ("load", "mu", "speed", "forse", "radiu", "x", "us", "Velocity"):
        known = ["normal_force", "velocity", "friction_coefficient", "indenter_radius"]
        found[f"{name}: hint"] = [errors.did_you_mean(name, known), errors.did_you_mean(name, known * 4)]
    names = (
        "Höhe",
        "Geschwindigkeit",
        "Reib-Wert",
        "G' [Pa]",
        "G″",
        "WEG",
        "Last",
        "Kinematische  Viskosität",
        " E_star.",
    )
    found |= {f"{name}: means": sorted(headings.meanings(name)) for name in names}
    record.check(dataframe_regression, found)


YAML = {
    "tab": "a: 1\n\tb: 2\n",
    "no blank": "a: 1\nb:2\nc: 3\n",
    "no blank above": "a: 1\nb:2\n# x\n c: 3\n",
    "star": "a: *x\n",
    "colon": "a: one two: 3\n",
    "columns": "a: 1\n  b: 2\n",
    "columns below a key": "a:\n  b: 1\n   c: 2\n",
    "open list": "a: [1, 2\nb: 3\n",
    "open quotes": "a: 'x\n",
    "twice": "a: 1\nb: {c: 1, c: 2}\na: 2\n",
    "keys": "1: 2\n? [a]\n: 3\ntrue: 4\n",
    "tags": "a: !x 1\nb: !!binary aGk=\nc: 2020-01-01\n",
    "numbers": "a: 0x1F\nb: 0o17\nc: -.inf\nd: .nan\ne: 1_000\nf: +3\ng: 1e3\nh: TRUE\ni: ~\nj: '7'\nk: 12e03\n",
    "digits": "a: " + "9" * 301 + "\nb: " + "9" * 300 + "\n",
    "control": "a: x\x07\nb: 1\n",
    "null character": 'a: "x\\0"\n',
    "long": "#" * 300_001,
    "as long as may be": "#" * 300_000,
    "deep": "a: " + "[" * 60 + "]" * 60,
    "nearly as deep": "a: " + "[" * 49 + "]" * 49,
    "anchors": "a: &x [1, 2]\nb: *x\nc: {<<: {d: 1}}\n",
    "nothing": "",
    "a list": "- a: 1\n  b: 2\n- [x, {y: z}]\n",
}


def test_record_of_documents(tmp_path, dataframe_regression):
    found = {}
    for name, text in YAML.items():
        wrong = problems.Problems()
        parsed = document.parse(text, "a.yaml", wrong)
        found[f"{name}: data"] = repr(parsed.data)[:200]
        found[f"{name}: wrong"] = str(said(wrong.raise_if_any))
        found[f"{name}: places"] = [f"{path} {parsed.place(path)} {parsed.key_place(path)}" for path in parsed._nodes][
            :9
        ]
    flowing = document.parse("a: {b: [1, 'x', ~], c: {d: 0x1}}", "a.yaml", problems.Problems())
    found["flow"] = [flowing.flow(("a",)), str(flowing.place(("a", "b", 7))), str(flowing.place(("z",)))]
    found["dotted"] = [problems.dotted(path) for path in ((), ("a",), ("a", 1, "b"), (0, "a"), ("a", 2, 3))]
    values = (None, {}, {"a": 1}, "x" * 58, "x" * 59, [1], [])
    found["shown"] = [problems.shown(value) for value in values]
    files = (
        "class: a.B",
        "class: B",
        "clas: a.B",
        "[1]",
        "class: a.B\narguments: 3\nscale: {jobs: 2}",
        "arguments: {}",
    )
    for text in files:
        (tmp_path / "c.yaml").write_text(text)
        found[f"cluster {text}"] = str(said(cluster.load_cluster, tmp_path / "c.yaml")).replace(str(tmp_path), "HERE")
    units_in = {
        "parameters": {
            "a": "1 mm",
            "b": ["1 N", "2 N"],
            "c": {"linear": ["1 s", "2 ms", 3]},
            "d": {"e": "2 deg", "f": 3},
        },
        "series": {"x": {"a": {"values": ["3 mm"]}, "g": {"geometric": ["1 Pa", "3 Pa", 4]}}, "y": {"b": "1 kN"}},
    }
    found["written units"] = str(written.written_units(json.dumps(units_in)))
    found["written units of none"] = str([written.written_units(text) for text in ("[1]", "a: [", "series: 3")])
    record.check(dataframe_regression, found)


def test_record_of_spreads_and_designs(dataframe_regression):
    found = {}
    for low, high in ((2.0, 700.0), (700.0, 2.0), (1.0, 3.0)):
        for geometric, whole in ((True, False), (False, False), (True, True), (False, True)):
            spread = Spread(low, high, geometric, whole)
            name = f"{low} to {high} {geometric} {whole}"
            found[f"{name}: at"] = spread.at(np.array([0.0, 0.13, 0.5, 0.77, 1.0]))
            found[f"{name}: shares"] = spread.shares([2.0, 2.7, 3.0])
            found[f"{name}: spaced"] = variation.spaced(spread, 7)
    found["exchanged"] = sampling._exchanged(np.arange(6.0).reshape(2, 3), -np.arange(6.0).reshape(2, 3))
    axis = loads(HEAD + "  normal_force: {linear: [1, 101, 101]}\n", "a.yaml", ".").series[0].axes[0]
    found["some"] = axis.some
    found["keys"] = told(
        keys.of_keys(
            {
                "model": "rubbing",
                "parameters": {"length": np.float64(3e-3), "normal_force": np.array([1.0, 2.5]), "points": range(3, 6)},
            }
        )
    )
    found["keys that are wrong"] = said(
        keys.of_keys, {"model": "rubbing", "parameters": {"length": Path("x"), "hurts": 1}}
    )
    record.check(dataframe_regression, found)


MEASURED = {
    "all": "normal_force [mN],velocity [mm/s],friction coefficient,error\n1,2,0.3,0.01\n3,1,0.4,0.02\n",
    "one condition": "velocity [m/s],friction_coefficient\n0.1,0.3\n7,0.4\n0.2,0.3\n9,1\n8,1\n-3,1\n",
    "no condition": "friction_coefficient\n0.3\n0.4\n",
    "no output": "velocity [m/s],frction\n1,2\n2,3\n",
    "two outputs": "friction_coefficient,indentation_depth [um]\n1,2\n2,3\n",
    "a short name": "radius [mm],friction_coefficient\n1,0.2\n2,0.3\n",
    "a note": "friction_coefficient,note\n0.3,1\n0.4,2\n",
    "at the ends": "velocity [m/s],friction_coefficient\n0.09999990001,1\n0.099999898,1\n0.9000008,1\n0.90000092,1\n",
    "one row": "velocity [m/s],friction_coefficient\n1,2\n",
    "an error of nothing": "velocity [m/s],friction_coefficient,uncertainty\n1,2,0\n2,2,1\n",
}


def test_record_of_measurements(tmp_path, dataframe_regression):
    found = {}
    parameters = {
        "one": "  normal_force: [1 mN, 3 mN]\n  velocity: {geometric: [0.1, 0.9, 4]}\n",
        "other": "  normal_force: 1 N\n"
        "  indenter: {shape: power, exponent: [1, 2], radius: 2 mm}\n  scheme: [exact, euler]\n",
        "two": "  velocity: [1, 2]\nseries: {a: {normal_force: [1, 2]}, b: {normal_force: 2, indenter: {shape: power, "
        "exponent: 2, radius: 1 mm}}}\n",
    }
    for name, text in MEASURED.items():
        (tmp_path / "m.csv").write_text(text)
        for which, given in parameters.items():
            whole = HEAD + given + "measured: {table: m.csv}\n"
            found[f"{name}, {which}"] = said(
                lambda whole: [
                    str(x)
                    for c in [loads(whole, "a.yaml", str(tmp_path))]
                    for x in (*measured.notes(c), measured.unknowns(c))
                ],
                whole,
            )
    (tmp_path / "m.csv").write_text(MEASURED["all"] + "#" * 10**6)
    found["too large"] = said(loads, HEAD + FORCE + "measured: {table: m.csv}\n", "a.yaml", str(tmp_path))
    record.check(dataframe_regression, found)
