"""Commands with every option on small studies: what they print, write, draw and refuse, as on record."""

import hashlib
import re
from pathlib import Path

import matplotlib.figure
import numpy as np
import planted
import pytest
import record
import seen

from mdr_dask import __version__
from mdr_dask.cli import main

V = "  velocity: {geometric: [0.01 mm/s, 1 m/s, 6]}\n"
F = "  normal_force: {geometric: [1 mN, 100 N, 5]}\n"
#: Studies by the name of their store: their text, and what is special.
STUDIES = {
    "grid": (planted.SLIDING + F + V + "  hurst: [0.3, 0.7]\n", {"failed": True}),
    "one": (planted.SLIDING + V + "  normal_force: 1 N\n", {"realisations": 1}),
    "series": (
        planted.SLIDING + V + "  normal_force: 1 N\nseries:\n  force: {normal_force: {geometric: [1 mN, 100 N, 4]}}\n"
        "  modulus: {shear_modulus: {geometric: [1 MPa, 100 MPa, 3]}}\n",
        {},
    ),
    "sampled": (
        planted.ROLLERS
        + "  normal_force: {linear: [200 N, 800 N]}\n  rotation_speed: {geometric: [10 rpm, 1000 rpm]}\n"
        "  temperature: {linear: [40 degC, 60 degC]}\nsampling: {saltelli: 16}\n",
        {},
    ),
    "jump": (planted.JUMP + V + "  hurst: 0.6\n  velocity_change: [-0.2, 0.2]\n  normal_force: 1 N\n", {}),
    "wear": (
        planted.FRETTING + f"  {planted.RULE}: [exact, fast]\n  stick_radius: 0.45\n  cycles: [0.5, 1, 2, 4]\n",
        {},
    ),
}
#: Printed numbers with so many digits are compared as numbers; of the others every digit counts.
LONG = re.compile(r"(?<![\w.])-?(?:\d+\.\d*|\.?\d{6,})(?:e[+-]\d+)?")
#: Letters of a text that stand in the record, and parts of its numbers.
MOST, FEW = 700, 4
#: What is another every time: times, sizes of files, versions.
MASKED = (
    (r"\b[\d.]+ (ms|s|min|h)\b(?= in the model| writing|: \d)", "TIME"),
    (r"about [\d.]+ (ms|s|min|h)\b", "about TIME"),
    (r"\d\d:\d\d:\d\d", "CLOCK"),
    (r'"(time|host|process|seconds|seconds_at_most)": [^,}]*', r'"\1": ...'),
    (r"\d+(\.\d+)? (B|kB|MB)\b", "SIZE"),
    (re.escape(__version__), "VERSION"),
    (r"sha256 \w+", "DIGEST"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    found = tmp_path_factory.mktemp("studies")
    for name, (text, special) in STUDIES.items():
        made = found / name
        made.mkdir()
        planted.make(made, text, **special)
        (made / "study.zarr").rename(found / f"{name}.zarr")
        (made / "study.yaml").rename(found / f"{name}.yaml")
    return found


@pytest.fixture
def told(folder, monkeypatch, capsys):
    """Return a function from a command to what it says, prints, writes and draws."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr("mdr_dask.cli.progress.PAUSE", 1e6)  # however busy the machine is
    monkeypatch.setenv("COLUMNS", "100")
    drawn = []

    def picture(figure, path, **options):
        Path(path).write_bytes(b"a picture")
        drawn.append((figure, options))

    monkeypatch.setattr(matplotlib.figure.Figure, "savefig", picture)

    def of(command):
        drawn.clear()
        code = main(command.split("'") if "'" in command else command.split())
        out, err = capsys.readouterr()
        found = said(f"{command}: {code}", f"{out}{err and ' ERR ' + err}")
        for number, (figure, options) in enumerate(drawn):
            found |= {f"figure {number} {what}": each for what, each in seen.of(figure).items()}
            found[f"figure {number} dots"] = list(options.values())
        return found

    return of


def said(name, text):
    """Words of a text, the end of a long one as a digest, and its long numbers."""
    text = record.unversioned(text)
    for pattern, word in MASKED:
        text = re.sub(pattern, word, text)
    numbers = [float(number) for number in LONG.findall(text) if digits(number) > 4]
    words = LONG.sub(lambda found: "~" if digits(found[0]) > 4 else found[0], text)
    words = re.sub(r"(?: *~,?)+", " ~", words)  # in columns as wide as their numbers
    words = re.sub(r"\n+", "|", re.sub(r"  +", "  ", words))
    end = words[MOST:] and f" ... {hashlib.sha256(words[MOST:].encode()).hexdigest()[:12]}"
    found = {"words": f"{name} {words[:MOST]}{end}"}
    parts = np.array_split(np.arcsinh(1e12 * np.array(numbers)), -(-len(numbers) // seen.MOST) or 1)
    return found | {f"numbers {k}": part for k, part in enumerate(parts[:FEW]) if part.size}


def digits(number):
    return len(number.partition("e")[0].replace(".", "").lstrip("-0"))


MU = "friction_coefficient"
#: A quotation mark parts the words of commands whose options hold spaces.
PRINTED = {
    "of_models": (
        "models",
        "models --json",
        *(f"models {name}" for name in ("sliding_friction", "velocity_jump", "mixed_lubrication", "toy")),
        "models ehl_line --json",
        "models fretting_wear",
        "models nonsense",
        "init fretting_wear",
        "init velocity_jump -o first.yaml",
        "init velocity_jump -o first.yaml",
        "check first.yaml",
        "check grid.yaml series.yaml sampled.yaml wear.yaml until.yaml names.yaml bad.yaml",
        "check series.yaml until.yaml names.yaml --json",
        "run grid.yaml --dry-run",
        "run one.yaml --store new.zarr --dry-run",
        "run one.yaml --store new.zarr --dry-run --json",
        "run one.yaml --part 3/2",
        "run one.yaml --threads 1 --workers 2",
        "run one.yaml --store memory://x",
        "schema -o schema.json",
        "nonsense",
        "",
    ),
    "of_runs": (
        "run toy.yaml --store r.zarr --threads 1 --log run.jsonl",
        "run toy.yaml --store r.zarr --threads 1",
        "run toy.yaml --store r.zarr --dry-run",
        "run more.yaml --store r.zarr --dry-run",
        "run more.yaml --store r.zarr --threads 1 --retry-failed",
        "run until.yaml --store u.zarr --threads 1 --quiet",
        "run until.yaml --store v.zarr --dry-run",
        "run toy.yaml --store p.zarr --part 1/3 --threads 1",
        "run toy.yaml --store p.zarr --part 3/3 --threads 1",
        "run toy.yaml --store p.zarr --dry-run --json",
        "run raises.yaml --store x.zarr --threads 1 --log raised.jsonl",
        "run toy.yaml --store u.zarr",
        "status r.zarr",
        "status r.zarr --failures",
        "status r.zarr --messages",
        "status p.zarr",
        "status p.zarr --watch",
        "status u.zarr --json",
        "verify r.zarr",
        "verify p.zarr --json",
        "verify r.zarr --campaign toy.yaml",
        "show r.zarr height width --limit 9",
        "aggregate r.zarr height trace --group-by slope",
        "show u.zarr height",
        "law u.zarr height -o height.nc",
        "figures toy.yaml -o drawn",
        "plot r.zarr width --over position --by slope -o width.png",
        "publish p.zarr -o p.zip",
        "publish r.zarr -o r.zip",
        "publish u.zarr -o u.zip --license CC-BY-4.0",
        "verify u.zip",
        "verify u.zip --repair",
        "report r.zarr u.zarr -o page.html",
        "report r.zarr -o page.txt",
    ),
    "of_results": (
        "status grid.zarr",
        "status series.zarr --json",
        "status grid.zarr --failures",
        "status one.zarr --failures",
        "status one.zarr --messages",
        "status grid.zarr --messages --json",
        "status grid.zarr --watch",
        "status grid.zarr --watch --json",
        f"show grid.zarr {MU}",
        f"show grid.zarr {MU} contact_fraction --limit 3",
        f"show one.zarr {MU} --limit 0",
        f"show one.zarr {MU} --csv",
        f"show grid.zarr {MU} --select hurst=0.3 --realisations --limit 7",
        f"show'grid.zarr'{MU}'--select'normal_force=0.1 N..50 N'--units'velocity=km/h,normal_force=mN'--sort'-velocity",
        f"show'grid.zarr'--where'{MU} > 0.002 and velocity < 3 km/h'--columns'velocity,{MU},load_number,status'--jsonl",
        f"show grid.zarr {MU} --group-by hurst,velocity --statistic mean --statistic quantile --json",
        f"show grid.zarr {MU} --where velocity>1e9",
        f"show series.zarr {MU} --series modulus --limit 4",
        f"show series.zarr {MU}",
        "show grid.zarr friction",
        f"show grid.zarr {MU} -o grid.zarr",
        f"show grid.zarr {MU} -o answer.txt",
        f"show grid.zarr {MU} -o answer.csv --csv",
        f"show grid.zarr {MU} -o answer.csv",
        f"show grid.zarr {MU} --select hurst=0.7 -o answer.json",
        f"show grid.zarr {MU} -o answer.parquet",
        f"show grid.zarr {MU} -o answer.nc",
        "show jump.zarr friction_coefficient_jump",
        f"aggregate grid.zarr {MU} --group-by normal_force",
        f"aggregate one.zarr {MU} --csv",
        f"aggregate grid.zarr {MU} --select hurst=0.3 --statistic interval --statistic grid_error --limit 5",
        "aggregate wear.zarr wear_volume --json",
        "aggregate wear.zarr wear_volume -o means.zarr",
        "verify one.zarr",
        "verify one.zarr --json",
        f"law grid.zarr {MU} -o mu.nc",
        f"law grid.zarr {MU} -o mu.txt",
        f"law'wear.zarr'wear_volume'--select'{planted.RULE}=fast'-o'volume.nc",
        "sensitivity sampled.zarr film_ratio",
        "sensitivity sampled.zarr film_ratio --csv",
        "sensitivity sampled.zarr film_ratio -o sobol.pdf",
        f"sensitivity grid.zarr {MU}",
        "fit grid.zarr",
        "fit series.zarr plateau contact_growth",
        "fit series.zarr plateau --series force --json",
        "fit grid.zarr zone_one plateau",
        "fit grid.zarr zone_one --csv",
        "fit grid.zarr nonsense",
        "fit grid.zarr plateau -o plateau.png",
        "fit jump.zarr kinetics --limit 2",
    ),
    "of_figures": (
        "plot grid.zarr",
        "plot grid.zarr velocity -o one.pdf",
        "plot grid.zarr regions force --select hurst=0.7 -o drawn --format svg",
        "plot one.zarr --all -o every",
        f"plot grid.zarr one.zarr {MU} --over velocity --by normal_force -o both.png",
        f"plot grid.zarr {MU} --over velocity --over normal_force --log xz --size 85x60mm -o drawn",
        f"plot grid.zarr {MU} contact_fraction --effects -o drawn --style grayscale",
        f"plot grid.zarr {MU} --over velocity --panels hurst --units velocity=km/h,hurst=percent -o drawn/p.svg",
        f"plot'grid.zarr'velocity'--where'{MU} < 0.003'--size'170mm'-o'slow.png",
        f"plot series.zarr {MU} --over velocity --series modulus --log none -o m.png",
        f"plot grid.zarr {MU}",
        f"plot grid.zarr {MU} --by hurst",
        f"plot grid.zarr {MU} --over velocity --effects",
        f"plot grid.zarr {MU} --over velocity --all",
        f"plot grid.zarr {MU} --over velocity --log q",
        f"plot grid.zarr {MU} --over velocity --over hurst --over normal_force",
        "plot grid.zarr velocity --units speed=km/h",
        "plot grid.zarr velocity force -o two.png",
        "plot grid.zarr velocity -o grid.zarr/one.png",
        "plot grid.zarr velocity -o shifted.png",
        "plot grid.zarr velocity --size 5m",
        "plot grid.zarr nonsense",
        "plot nowhere.zarr velocity",
        "master-curve grid.zarr --over velocity --by normal_force --select hurst=0.3 --plot merged.png",
        "master-curve shifted.csv --reference 37 -o kept.json --csv",
        "master-curve kept.json --reference 50 --show curve --csv",
        "master-curve kept.json --by T",
        "master-curve shifted.csv --show points --csv --vertical",
        "master-curve shifted.csv --series one",
        "surface scan.csv -o c2d.csv --plot rough.png",
        "surface scan.csv --plot scan.png",
        "surface scan.csv scan.csv --csv --detrend parabola --window none",
        "surface map.npy --spacing 3um --spacing-y 2um --unit nm --direction y --outliers fill --json",
        "surface c2d.csv",
        "surface scan.csv -o scan.txt --as spectrum",
    ),
}
#: Files that commands leave behind.
FILES = {
    "of_models": ("first.yaml",),
    "of_runs": ("run.jsonl", "raised.jsonl", "width.csv"),
    "of_results": ("answer.csv", "answer.json"),
    "of_figures": ("one.csv", "both.csv", "slow.csv", "c2d.csv", "rough.csv", "merged.csv"),
}


@pytest.fixture
def inputs(folder):
    """Files that commands read: campaigns, a table of curves that shift, a scan and a map."""
    (folder / "until.yaml").write_text(
        "name: until\nseed: 1\nmodel: toy\nrealisations: {until: {height: 10 %}, at_least: 3, at_most: 37}\n"
        "parameters:\n  noise: 0.3\n  position: {adaptive: [1 m, 90 m], until: {height: 5 %}, at_most: 21}\n"
    )
    (folder / "names.yaml").write_text(
        f"name: names\nseed: 1\nrealisations: 3\n{planted.FRETTING}  {planted.RULE}: [exact, fast, limit]\n"
        "  stick_radius: {linear: [0.1, 0.7, 9]}\n  cycles: [0.1, 0.2, 0.5, 1, 2, 3, 7, 8]\n  hold: [depth, force]\n"
    )
    study = "name: toy\nseed: 3\nmodel: toy\nrealisations: 4\noutputs: [height, trace, width]\nparameters:\n"
    axes = "  slope: [0.5, 2, 7]\n  fail_above: 3.5 m\n  position: [1 m, 2.5 m, 3.7 m, 5 m]\n"
    (folder / "toy.yaml").write_text(study + axes)
    (folder / "more.yaml").write_text((study + axes).replace("realisations: 4", "realisations: 6"))
    (folder / "raises.yaml").write_text(f"{study}  position: [1 m, 3 m]\n  raise_above: 2 m\n")
    (folder / "bad.yaml").write_text("name: bad\nmodel: toy\nparameters:\n  slop: 2\n  position: 3 kg\n")
    times, shifts = np.geomspace(1, 1000, 17), {20: 0.0, 31: -1.21, 43: -2.14, 58: -3.33, 70: -3.98}
    rows = [
        f"{T},{t:.6g},{1e6 / (1 + (t / 10**a) ** 0.3) * (1 + 0.004 * np.sin(7 * T + 3 * k)):.9g}"
        for T, a in shifts.items()
        for k, t in enumerate(times)
    ]
    (folder / "shifted.csv").write_text("\n".join(["T,time,modulus", *rows]))
    chance = np.random.default_rng(3)
    height, place = chance.standard_normal(301).cumsum(), np.arange(301) * 0.01
    np.savetxt(folder / "scan.csv", np.c_[place, height], delimiter=",", header="x [mm],z [um]", comments="")
    np.save(folder / "map.npy", chance.standard_normal((48, 40)).cumsum(0).cumsum(1))
    return folder


@pytest.mark.parametrize("part", PRINTED)
def test_commands_say_what_they_said(part, inputs, told, toy, dataframe_regression):
    found = {}
    for number, command in enumerate(PRINTED[part]):
        found |= {f"{number} {name}": value for name, value in told(command).items()}
    for name in FILES[part]:
        found |= {f"{name} {what}": value for what, value in said(name, Path(name).read_text()).items()}
    record.check(dataframe_regression, found)
