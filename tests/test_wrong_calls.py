"""Wrong options, wrong files, full disks, damaged stores: one error with exit code 2, and nothing is written."""

import json
import shutil
from pathlib import Path

import pytest
from small_campaign import CAMPAIGN

from mdr_dask.cli import main

#: Command line, and the parts that the error must name: file and place, value, remedy. STORE is a filled store, FOREIGN
#: a Zarr group of somebody else. Targets below new/ show that a refused command creates nothing.
WRONG = [
    # options
    ("run small.yaml --threads 0", "0", "1"),
    ("run small.yaml --threads 2 --workers 2", "--threads, --workers"),
    ("run small.yaml --part 4/3", "K/N", "'4/3'"),
    ("show STORE -o x.csv --json", "--json and --output"),
    ("show STORE -o x.nc --sort velocity", ".csv", "--sort"),
    ("plot STORE friction_coefficient --over a --over b --over c", "--over once"),
    ("plot STORE friction_coefficient --over velocity --log q", "x, y and z", "'q'"),
    ("plot STORE friction_coefficient --over velocity --size 85", "'85mm'"),
    # names
    ("models nobody", "'nobody'", "known: sliding_friction"),
    ("show STORE friction", "'friction'", "did you mean 'friction_coefficient'?"),
    ("show STORE --series x", "'x'", "leave out --series"),
    ("show STORE --statistic median", "'median'", "'mean'"),
    ("show STORE --select speed=1", "'speed'", "did you mean 'velocity'?"),
    ("fit STORE nothing", "'nothing'", "known: calibration, zone_one"),
    ("plot STORE nothing -o new/x.png", "'nothing'", "known: velocity, force"),
    ("plot STORE velocity --units velocty=km/h", "'velocty'", "did you mean 'velocity'?"),
    ("plot STORE friction_coefficient --over velocity --style graysale", "'graysale'", "did you mean 'grayscale'?"),
    # values
    ("show STORE --select velocity=1kg", "velocity: ", "'1 mm/s'", "'1kg'"),
    ("show STORE --where velocity>1kg -o new/x.zarr", "'velocity>1kg'"),
    ("sensitivity STORE friction_coefficient -o new/x.png", "saltelli"),
    # files that are read
    ("check nowhere.yaml", "nowhere.yaml"),
    ("run small.yaml --cluster small.yaml", "small.yaml:1:1: name", "known: class"),
    ("run small.yaml --cluster class.yaml", "class.yaml:1:8: class", "dask_jobqueue"),
    ("run small.yaml --cluster number.yaml", "number.yaml:2:12: arguments", "3"),
    ("run small.yaml --cluster system.yaml", "'os.system'", "class of Dask clusters"),
    ("surface nowhere.csv -o new/x.csv --plot new/x.png", "nowhere.csv"),
    ("master-curve nowhere.csv", "nowhere.csv: "),
    # stores
    ("status nowhere.zarr", "nowhere.zarr: no store here", "mdr-dask run"),
    ("status FOREIGN", "FOREIGN: ", "not a study of mdr_dask"),
    ("run small.yaml --store nobody://x", "nobody://x: ", "fsspec"),
    ("run other.yaml --store STORE", "STORE: ", "--store"),
    ("run small.yaml --scheduler nowhere --store new/deep/x.zarr", "'nowhere'"),
    ("run small.yaml --cluster broken.yaml --store new/x.zarr", "'distributed.LocalCluster'"),
    # files that are written
    ("show STORE -o means.xls", ".csv, .json", "means.xls"),
    ("plot STORE velocity -o velocity.bmp", ".png, .pdf or .svg", "'velocity.bmp'"),
    ("plot STORE velocity force -o both.png", "folder", "'both.png'"),
    ("show STORE -o STORE", "new file", "'STORE'"),
    ("publish STORE -o STORE/x.zip", "outside every store", "'STORE/x.zip'"),
    ("run small.yaml --store STORE --log STORE/x.jsonl", "outside every store"),
    ("init sliding_friction -o small.yaml", "small.yaml", "exists already"),
    ("run small.yaml --log small.yaml/x.jsonl", "small.yaml/x.jsonl: Not a directory"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with campaigns, right and wrong, a filled store and a Zarr group that is none."""
    folder = tmp_path_factory.mktemp("wrong")
    for name, text in {
        "small.yaml": CAMPAIGN,
        "other.yaml": CAMPAIGN.replace("hurst: 0.7", "hurst: 0.6"),
        "class.yaml": "class: LocalCluster\n",
        "system.yaml": "class: os.system\narguments: {command: touch ran}\n",
        "broken.yaml": "class: distributed.LocalCluster\narguments: {nobody: 1}\n",
        "number.yaml": "class: distributed.LocalCluster\narguments: 3\n",
        "notes.txt": "what we did\n",
    }.items():
        (folder / name).write_text(text)
    (folder / "FOREIGN").mkdir()
    (folder / "FOREIGN/zarr.json").write_text(json.dumps({"zarr_format": 3, "node_type": "array"}))
    with pytest.MonkeyPatch.context() as here:
        here.chdir(folder)
        assert main(["run", "small.yaml", "--store", "STORE.zarr", "--quiet"]) == 0
    return folder


def contents(folder: Path) -> dict[Path, bytes | None]:
    """Return what files hold, and None for folders."""
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.mark.parametrize("case", WRONG, ids=[case[0] for case in WRONG])
def test_one_error_and_nothing_written(folder, monkeypatch, capsys, case):
    monkeypatch.chdir(folder)
    before = contents(folder)
    line, *parts = (text.replace("STORE", "STORE.zarr") for text in case)
    assert main(line.split()) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert all(part in streams.err for part in parts), streams.err
    assert contents(folder) == before


#: Commands that take a store, and the same from Python.
COMMANDS = [
    "status FILE",
    "show FILE",
    "fit FILE zone_one",
    "plot FILE velocity -o new/x.png",
    "law FILE friction_coefficient -o new/x.nc",
    "sensitivity FILE friction_coefficient",
    "report FILE -o new/x.html",
    "publish FILE -o new/x.zip",
    "verify FILE",
    "run small.yaml --store FILE",
    "run small.yaml --store FILE --part 1/2",
]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_says_that_a_file_is_no_store(folder, monkeypatch, capsys, line):
    monkeypatch.chdir(folder)
    before = contents(folder)
    assert main(line.replace("FILE", "small.yaml").split()) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert error.startswith("small.yaml: a file, expected the folder of a store")
    assert "'mdr-dask run small.yaml' runs a campaign" in error
    assert contents(folder) == before


def test_a_packed_study_is_to_be_unpacked(folder, tmp_path, capsys):
    packed = shutil.make_archive(str(tmp_path / "study"), "zip", folder, "STORE.zarr")
    assert main(["status", packed]) == 2
    assert f"{packed}: a file, expected the folder of a store; unpack it first" in capsys.readouterr().err


READING = [
    ("show damaged.zarr", "friction_coefficient"),
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
        assert main(["show", "STORE.zarr", "-o", target]) == 0
    capsys.readouterr()
    assert main(["run", "small.yaml", "--store", target]) == 2
    assert "not a study" in capsys.readouterr().err
