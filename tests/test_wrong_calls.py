"""Wrong options, wrong files, full disks, damaged stores: one error with the exit code 2, and nothing written."""

import json
import re
import shutil
from pathlib import Path

import pytest
from test_cli import CAMPAIGN

import mdr_dask
from mdr_dask.cli import main
from mdr_dask.errors import MdrDaskError

#: Command line, and what the error has to say; STORE is a filled store, FOREIGN a Zarr group of somebody else.
WRONG = [
    ("check nowhere.yaml", "File 'nowhere.yaml' does not exist"),
    ("models nobody", "unknown model 'nobody' (known: sliding_friction"),
    ("run small.yaml --threads 0", "0 is not in the range x>=1"),
    ("run small.yaml --threads 2 --workers 2", "expected one of --threads, --workers, got 2 of them"),
    ("run small.yaml --store small.yaml", "small.yaml: a file, expected the folder of a store or nothing"),
    ("run small.yaml --store FOREIGN", "FOREIGN: a Zarr store, but not a study of mdr_dask"),
    ("run small.yaml --store nobody://x", "nobody://x: expected a path, or a URL that fsspec can open: Protocol not"),
    ("run small.yaml --store small.yaml/x.zarr", "small.yaml/x.zarr: small.yaml is a file, expected the folder of"),
    ("run other.yaml --store STORE", "STORE: made from another campaign; give this one a store of its own (--store):"),
    ("run other.yaml --store STORE --dry-run", "hurst: 0.7 in the store, 0.6 in the campaign"),
    ("run large.yaml", "large.yaml: one case needs about"),
    (
        "run small.yaml --cluster small.yaml",
        "small.yaml:1:1: name: unknown key (known: class, arguments, scale, adapt)",
    ),
    ("run small.yaml --part 0/3", "--part: expected K/N with K from 1 to N, such as 3/8, got '0/3'"),
    ("run small.yaml --part 4/3", "--part: expected K/N with K from 1 to N, such as 3/8, got '4/3'"),
    ("run small.yaml --part 3", "--part: expected K/N with K from 1 to N, such as 3/8, got '3'"),
    ("run small.yaml --log small.yaml/x.jsonl", "small.yaml/x.jsonl: Not a directory"),
    (
        "run small.yaml --cluster system.yaml",
        "cannot start 'os.system': expected a class of Dask clusters, got builtin",
    ),
    ("status STORE --watch --json", "expected --watch alone, without --failures, --messages and --json"),
    ("run small.yaml --cluster class.yaml", "class.yaml:1:8: class: expected a class such as dask_jobqueue.SLURM"),
    ("run small.yaml --cluster number.yaml", "number.yaml:2:12: arguments: expected a mapping, got 3"),
    ("run small.yaml --cluster list.yaml", "list.yaml:1:1: expected a mapping with the key class, got ['class']"),
    ("run small.yaml --cluster latin.yaml", "latin.yaml:1:1: expected UTF-8 text, got byte 0xb5"),
    ("status small.yaml", "small.yaml: a file, expected the folder of a store"),
    ("status nowhere.zarr", "nowhere.zarr: no store here; 'mdr-dask run CAMPAIGN' makes one"),
    ("status FOREIGN", "FOREIGN: a Zarr store, but not a study of mdr_dask"),
    ("show .", ".: no store here"),
    ("show STORE friction", "no output 'friction' in this study (did you mean 'friction_coefficient'?)"),
    ("show STORE --series x", "no series 'x'; known: none, leave --series out"),
    ("show STORE --statistic median", "'median' is not one of 'mean'"),
    ("show STORE --select speed=1", "no axis 'speed' in this study (did you mean 'velocity'?)"),
    ("show STORE --select velocity=1kg", "velocity: expected a velocity (such as '1 mm/s'), got '1kg'"),
    ("show STORE --select velocity=2..1", "no velocity 2 m/s .. 1 m/s: it has the values 0.001 m/s, 0.01 m/s"),
    ("show STORE --units velocity=N", "velocity: expected a velocity (such as '1 mm/s'), got 'N'"),
    ("show STORE --limit -1", "-1 is not in the range x>=0"),
    ("aggregate STORE -o means.xls", "expected a file that ends in .csv, .json, .jsonl, .parquet, .nc or .zarr, got"),
    ("aggregate STORE -o STORE", "expected a new file, got the store of a study: 'STORE'"),
    ("show STORE -o x.csv --json", "expected one of --json and --output, got both"),
    ("show STORE -o x.nc --sort velocity", "expected a table (.csv, .jsonl or .parquet) with --sort"),
    ("show STORE --where velocity>1kg", "'velocity>1kg': expected quantities of one dimension"),
    (
        "show STORE --where velocity=1",
        "expected a condition such as 'velocity > 1 mm/s and hurst < 0.7', got 'velocity=1'",
    ),
    ("show STORE --columns wear", "no column 'wear'; known: "),
    ("show STORE --group-by case", "expected axes to group by, got 'case'"),
    ("aggregate STORE -o small.yaml/x.csv", "small.yaml/x.csv: Not a directory"),
    ("fit STORE nothing", "no law for sliding_friction is called 'nothing'; known: calibration, zone_one"),
    (
        "plot STORE nothing",
        "no figure of sliding_friction is called 'nothing'; known: velocity, force",
    ),
    ("plot STORE friction_coefficient", "--over"),
    (
        "plot STORE friction_coefficient --over velocity --style graysale",
        "expected a style file, or the name of a style of matplotlib (did you mean 'grayscale'?), got 'graysale'",
    ),
    ("plot STORE friction_coefficient --over speed", "no axis 'speed' (did you mean 'velocity'?)"),
    (
        "plot STORE friction_coefficient --over velocity --effects",
        "expected --over once, twice for a map, or --effects",
    ),
    (
        "plot STORE friction_coefficient --over velocity --log q",
        "expected --log with letters of xyz, or 'none', got 'q'",
    ),
    ("plot STORE velocity --units velocty=km/h", "no quantity 'velocty' to give a unit (did you mean 'velocity'?)"),
    ("plot STORE friction_coefficient --over velocity --units velocity=kg", "velocity: expected a velocity"),
    (
        "plot STORE friction_coefficient --over velocity --size 85",
        "expected a width such as '85mm', or width and height",
    ),
    ("plot STORE velocity --by normal_force", "--by is for an output with --over or --effects"),
    ("plot STORE nowhere.zarr velocity", "nowhere.zarr: no store here"),
    ("plot STORE velocity --format bmp", "'bmp' is not one of 'png', 'pdf', 'svg'"),
    ("plot STORE velocity -o velocity.bmp", "expected a file that ends in .png, .pdf or .svg, got 'velocity.bmp'"),
    ("plot STORE velocity force -o both.png", "expected a folder for the figures, got 'both.png'"),
    ("plot STORE velocity -o small.yaml/x.png", "small.yaml/x.png: Not a directory"),
    ("schema -o small.yaml/x.json", "small.yaml/x.json: Not a directory"),
    ("run small.yaml --scheduler nowhere --store new/deep/x.zarr", "no Dask scheduler answers at 'nowhere'"),
    ("run small.yaml --part 1/2 --scheduler nowhere --store new/x.zarr", "no Dask scheduler answers at 'nowhere'"),
    ("run small.yaml --cluster broken.yaml --store new/x.zarr", "cannot start 'distributed.LocalCluster': "),
    ("run large.yaml --store new/x.zarr", "large.yaml: one case needs about"),
    ("show STORE nothing -o new/x.csv", "no output 'nothing' in this study"),
    ("show STORE --where velocity>1kg -o new/x.zarr", "expected quantities of one dimension"),
    ("aggregate STORE --select hurst=0.1 -o new/x.nc", "no hurst 0.1"),
    ("plot STORE nothing -o new/x.png", "no figure of sliding_friction is called 'nothing'"),
    (
        "plot STORE friction_coefficient --over velocity --where velocity<0 -o new/x.png",
        "--where velocity<0: no result",
    ),
    ("plot STORE velocity --style nothing -o new/x.png", "expected a style file"),
    ("fit STORE calibration -o new/x.csv", "expected a file that ends in .png, .pdf or .svg"),
    ("fit STORE calibration -o new/x.png", "table"),
    ("law STORE nothing -o new/x.nc", "no output 'nothing' in this study"),
    ("law STORE friction_coefficient -o new/x.xls", "x.xls"),
    ("sensitivity STORE friction_coefficient -o new/x.png", "indices need a sampled study"),
    ("surface nowhere.csv -o new/x.csv --plot new/x.png", "nowhere.csv"),
    ("init nobody -o new/x.yaml", "unknown model 'nobody'"),
    ("init sliding_friction -o small.yaml", "small.yaml"),
    ("report nowhere.zarr -o new/x.html", "nowhere.zarr: no store here"),
    ("report STORE -o STORE", "STORE"),
    ("publish nowhere.zarr -o new/x.zip", "nowhere.zarr: no store here"),
    ("publish STORE -o STORE/x.zip", "expected a file outside of stores, got 'STORE/x.zip'"),
    ("plot STORE velocity -o STORE/x.png", "expected a file outside of stores"),
    ("run small.yaml --store STORE --log STORE/x.jsonl", "expected a file outside of stores"),
    ("master-curve small.yaml -o new/x.json", "small.yaml"),
    ("master-curve nowhere.csv", "nowhere.csv: no such table or store"),
    ("master-curve STORE --over velocity --plot x.bmp", "expected a file that ends in .png, .pdf or .svg, got 'x.bmp'"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with campaigns, right and wrong, a filled store and a Zarr group that is none."""
    folder = tmp_path_factory.mktemp("wrong")
    for name, text in {
        "small.yaml": CAMPAIGN,
        "other.yaml": CAMPAIGN.replace("hurst: 0.7", "hurst: 0.6"),
        "large.yaml": CAMPAIGN.replace("points: 500", "points: 1000000\n  oversampling: 256"),
        "class.yaml": "class: LocalCluster\n",
        "system.yaml": "class: os.system\narguments: {command: touch ran}\n",
        "broken.yaml": "class: distributed.LocalCluster\narguments: {nobody: 1}\n",
        "number.yaml": "class: distributed.LocalCluster\narguments: 3\n",
        "list.yaml": "[class]\n",
        "notes.txt": "what we did\n",
    }.items():
        (folder / name).write_text(text)
    (folder / "latin.yaml").write_bytes("µ: 1\n".encode("latin-1"))
    (folder / "FOREIGN").mkdir()
    (folder / "FOREIGN/zarr.json").write_text(json.dumps({"zarr_format": 3, "node_type": "array"}))
    with pytest.MonkeyPatch.context() as here:
        here.chdir(folder)
        assert main(["run", "small.yaml", "--store", "STORE.zarr", "--quiet"]) == 0
    return folder


def contents(folder: Path) -> dict[Path, bytes | None]:
    """Return what files hold, and None for folders."""
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.mark.parametrize(("line", "told"), WRONG, ids=[line for line, _ in WRONG])
def test_one_error_and_nothing_written(folder, monkeypatch, capsys, line, told):
    monkeypatch.chdir(folder)
    before = contents(folder)
    assert main(line.replace("STORE", "STORE.zarr").split()) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert told.replace("STORE", "STORE.zarr") in streams.err
    assert contents(folder) == before


#: Commands that take a store, and the same from Python.
COMMANDS = [
    "status FILE",
    "show FILE",
    "aggregate FILE",
    "fit FILE zone_one",
    "plot FILE",
    "plot FILE velocity -o new/x.png",
    "master-curve FILE",
    "law FILE friction_coefficient -o new/x.nc",
    "sensitivity FILE friction_coefficient",
    "report FILE -o new/x.html",
    "publish FILE -o new/x.zip",
    "verify FILE",
    "verify FILE --repair",
    "run small.yaml --store FILE",
    "run small.yaml --store FILE --dry-run",
    "run small.yaml --store FILE --part 1/2",
]
CALLS = {
    "open": lambda file: mdr_dask.open(file),
    "fit": lambda file: mdr_dask.fit(file, "zone_one"),
    "plot": lambda file: mdr_dask.plot(file, "velocity"),
    "table": lambda file: mdr_dask.table(file),
    "aggregate": lambda file: mdr_dask.aggregate(file),
    "master_curve": lambda file: mdr_dask.master_curve(file),
    "run": lambda file: mdr_dask.run("small.yaml", store=file),
}
FILES = {
    "small.yaml": "small.yaml: a file, expected the folder of a store",
    "small.yaml/x": "small.yaml/x: small.yaml is a file, expected the folder of a store",
    "notes.txt": "notes.txt: a file, expected the folder of a store",
}
#: What may also be given a table, and speaks of tables.
OF_TABLES = ("master-curve", "master_curve")


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_says_that_a_file_is_no_store(folder, monkeypatch, capsys, line, file):
    monkeypatch.chdir(folder)
    before = contents(folder)
    assert main(line.replace("FILE", file).split()) == 2
    errors = capsys.readouterr().err
    if line.split()[0] not in OF_TABLES or file == "small.yaml":
        assert errors.startswith(FILES[file])
        assert errors.count("\n") == 1
        assert ("'mdr-dask run small.yaml' runs a campaign" in errors) == (file != "notes.txt")
    assert contents(folder) == before


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("name", CALLS)
def test_every_function_says_that_a_file_is_no_store(folder, monkeypatch, name, file):
    monkeypatch.chdir(folder)
    before = contents(folder)
    told = FILES[file] if name not in OF_TABLES or file != "notes.txt" else "notes.txt:1:1: "
    with pytest.raises(MdrDaskError, match=re.escape(told)):
        CALLS[name](file)
    assert contents(folder) == before


def test_a_packed_study_is_to_be_unpacked(folder, tmp_path, capsys):
    packed = shutil.make_archive(str(tmp_path / "study"), "zip", folder, "STORE.zarr")
    assert main(["status", packed]) == 2
    assert f"{packed}: a file, expected the folder of a store; unpack it first" in capsys.readouterr().err


READING = [(f"{command} damaged.zarr", "friction_coefficient") for command in ("show", "aggregate")]
READING += [
    ("fit damaged.zarr zone_one", "friction_coefficient"),
    ("plot damaged.zarr velocity", "friction_coefficient"),
]
READING += [("status damaged.zarr", "status"), ("run small.yaml --store damaged.zarr", "status")]


@pytest.mark.parametrize(("line", "array"), READING)
def test_a_damaged_chunk_is_named_by_its_store(folder, tmp_path, monkeypatch, capsys, line, array):
    monkeypatch.chdir(tmp_path)
    shutil.copy(folder / "small.yaml", tmp_path)
    shutil.copytree(folder / "STORE.zarr", "damaged.zarr")
    for chunk in Path("damaged.zarr", array, "c").rglob("*"):
        if chunk.is_file():
            chunk.write_bytes(b"not what was written here")
    assert main(line.split()) == 2
    errors = capsys.readouterr().err
    assert "damaged.zarr: " in errors
    assert len(errors.splitlines()) == 1


def test_a_full_disk_is_named(folder, tmp_path, monkeypatch, capsys):
    """The file is begun, and has to go."""
    from matplotlib.figure import Figure

    def half(_: Figure, path: Path, **_options: object) -> None:
        path.write_bytes(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.chdir(folder)
    monkeypatch.setattr(Figure, "savefig", half)
    target = tmp_path / "figures/velocity.png"
    assert main(["plot", "STORE.zarr", "velocity", "-o", str(target)]) == 2
    assert capsys.readouterr().err == f"{target}: No space left on device\n"
    assert not target.exists()


def test_statistics_replace_older_ones_and_are_no_study(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    target = str(tmp_path / "new/means.zarr")
    for _ in range(2):
        assert main(["aggregate", "STORE.zarr", "-o", target]) == 0
    capsys.readouterr()
    assert main(["run", "small.yaml", "--store", target]) == 2
    assert "not a study" in capsys.readouterr().err
