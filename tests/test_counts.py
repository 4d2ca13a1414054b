"""What a change must not increase, counted: sweeps, transforms, lines, solves, tasks, files, modules, files read."""

import json
import os
import re
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from planted import SLIDING, make

from mdr_dask import store
from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.execute import Resources, run
from mdr_dask.models import load
from mdr_dask.models.base import Block
from mdr_dask.physics.sliding import kelvin, steady
from mdr_dask.physics.surfaces import roughness, waves
from mdr_dask.physics.surfaces.cubic_line import cut, periodic_line
from mdr_dask.store import files

HEAVY = {"dask", "distributed", "matplotlib", "numba", "pandas", "pint", "scipy", "xarray", "zarr"}
STORE = HEAVY - {"pandas", "xarray", "zarr"}  # what a reader of stores has no need of
#: Command: what it must not load (pint looks for dask and scipy itself), and arrays whose chunks it may open.
COMMANDS = {
    "models sliding_friction": (HEAVY, set()),
    "schema -o schema.json": (HEAVY, set()),
    "init sliding_friction -o mine.yaml": (HEAVY - {"pint", "dask", "scipy"}, set()),
    "check study.yaml": ({"distributed", "matplotlib", "pandas", "xarray", "zarr"}, set()),
    "run more.yaml --threads 1": ({"distributed", "matplotlib", "pandas", "xarray"}, ...),
    "run done.yaml --dry-run": ({"distributed", "matplotlib"}, {"status"}),
    "status study.zarr": (STORE - {"pint", "dask", "scipy"}, ...),
    "show study.zarr friction_coefficient": (
        STORE - {"pint", "dask", "scipy"},
        {"friction_coefficient", "friction_coefficient_error", "status"},
    ),
    "show study.zarr rms_slope --select normal_force=0.1": (STORE - {"pint", "dask", "scipy"}, {"rms_slope", "status"}),
    "aggregate study.zarr friction_coefficient": (
        {"matplotlib", "numba", "distributed"},
        {"friction_coefficient", "friction_coefficient_error", "status"},
    ),
    "law study.zarr contact_fraction -o law.nc": (
        {"matplotlib", "numba"},
        {"contact_fraction", "contact_fraction_error", "status"},
    ),
    "plot study.zarr velocity -o velocity.png": (
        {"distributed"},
        {"friction_coefficient", "friction_coefficient_error", "rms_slope", "status"},
    ),
    "surface line.csv": (HEAVY - {"pint", "dask", "scipy"}, set()),
}
OUTPUTS = re.compile(r"study\.zarr/(\w+)/c")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """What each command did, alone in a process that had loaded nothing."""
    folder = tmp_path_factory.mktemp("counts")
    axes = "  normal_force: {geometric: [0.1 N, 10 N, 4]}\n  velocity: {geometric: [1 mm/s, 1 m/s, 7]}\n"
    data = make(folder, SLIDING + axes)[""]
    (folder / "results").mkdir()
    (folder / "study.zarr").rename(folder / "results/study.zarr")
    (folder / "study.zarr").symlink_to("results/study.zarr")
    (folder / "done.yaml").write_text((folder / "study.yaml").read_text())
    (folder / "more.yaml").write_text((folder / "study.yaml").read_text().replace("name: study", "name: more"))
    (folder / "line.csv").write_text("x [m],z [m]\n" + "".join(f"{i}e-6,{i * 7919 % 13}e-8\n" for i in range(256)))
    script = Path(__file__).parent / "commands_apart.py"
    commands = [command.split() for command in COMMANDS]
    found = subprocess.run(
        [sys.executable, "-P", str(script), json.dumps(commands)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return dict(zip(COMMANDS, json.loads(found.stdout), strict=True)) | {"outputs": {*map(str, data.data_vars)}}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_loads_and_reads_only_what_it_needs(command, done):
    forbidden, readable = COMMANDS[command]
    found = done[command]
    assert found["code"] == 0, found["told"]
    assert not forbidden & set(found["modules"])
    opened = Counter(name for path in found["opened"] for name in OUTPUTS.findall(path))
    read = set(opened) & done["outputs"]
    assert readable is ... or read <= readable
    coordinates = {name: count for name, count in opened.items() if name not in done["outputs"]}
    assert max(coordinates.values(), default=0) <= 4, coordinates  # however many steps a reduction has


def test_a_block_is_one_task_and_one_file_of_every_array(toy, url):
    """Six blocks of two cases and three realisations; one record each while at work, one for all in the end."""
    study = replace(
        toy.campaign(toy.axis("position", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])), blocks={"position": 2, "realisation": 3}
    )
    progress = run(study, url, Resources(), lambda _: None)
    assert progress.blocks == 6
    assert len(toy.COMPUTED) == progress.solves == 36
    files = Counter(path.relative_to(url).parts[0] for path in Path(url).rglob("*") if path.is_file())
    assert files["height"] == 6 + 1
    assert sum("/status/c/" in str(path) for path in Path(url).rglob("*")) == 3 + 6
    assert sum(files.values()) <= 40
    assert run(study, url, Resources(), lambda _: None).blocks == 0
    assert len(toy.COMPUTED) == 36


def test_a_round_writes_what_changes_and_reads_no_block(toy, url, monkeypatch):
    """Two rounds of which the second needs some cases alone: new blocks, longer arrays, and no coordinate but one."""
    written, read, give_name, read_block = [], [], files.give_name, store.read_block
    monkeypatch.setattr(files, "give_name", lambda *paths: written.append(paths[1]) or give_name(*paths))
    monkeypatch.setattr(store, "read_block", lambda *given: read.append(given) or read_block(*given))
    tolerance = {"height": Tolerance(absolute=1.0)}
    study = toy.campaign(toy.axis("position", [1.0, 100.0]), realisations=Replication(10, 20, tolerance))
    run(replace(study, blocks={"realisation": 10}), url, Resources(threads=1), lambda _: None)
    assert 20 < len(toy.COMPUTED) < 40
    assert not read
    layout = Counter(path.relative_to(url).as_posix() for path in written if "/c/" not in str(path))
    coordinates = {name for name, count in layout.items() if name.endswith("/zarr.json") and count > 1}
    assert coordinates == {"height/zarr.json", "status/zarr.json", "realisation/zarr.json"}
    assert Counter(path.relative_to(url).parts[0] for path in written if "/c/" in str(path))["position"] == 1


def line(points, oversampling, hurst=0.7, seed=0):
    amplitude, phase = roughness.amplitudes(points // 2, hurst), roughness.phases(seed, 0, points // 2)
    return periodic_line(*(roughness.line(amplitude, phase, points * oversampling, order) for order in (0, 1)))


def test_sweeps_of_a_solution(sweeps):
    """Loads and speeds as campaigns have them: the search follows its neighbour, and knows the slope of the load."""
    deborah, load = (grid.ravel() for grid in np.meshgrid(np.geomspace(1e-5, 1e-1, 8), np.geomspace(1e-3, 10, 20)))
    found = steady.steady_sliding(line(500, 4), deborah, load)
    assert np.all(found.status == 0)
    assert len(sweeps) / load.size < 4.0
    few = len(sweeps)
    again = steady.steady_sliding(line(500, 4), deborah, load, guesses=found.depth)
    assert np.array_equal(again.drag, found.drag)
    assert (len(sweeps) - few) / load.size < 2.5
    alone = len(sweeps)
    steady.steady_sliding(line(500, 4), deborah[:1], load[:1])
    assert len(sweeps) - alone < 12


@pytest.mark.parametrize(("seed", "speed", "most"), [(0, 0.005, 8), (2, 0.02, 5)])
def test_sweeps_of_states_near_full_contact(seed, speed, most, sweeps):
    """Guesses from below would leap far beyond full contact and back; the next speed is near."""
    found = steady.steady_sliding(line(2000, 4, 0.0, seed), speed * np.array([1, 1.2]), np.full(2, 0.3))
    assert np.all(found.status == 0)
    assert len(sweeps) <= most


class Visited(np.ndarray):
    """An array that counts which of its entries are looked at."""

    def __getitem__(self, place):
        self.seen.add(place)
        return float(np.asarray(self)[place])


def test_nodes_visited_at_light_load(monkeypatch):
    """A sweep that touches a hundredth of the line looks at few cells: the others are passed in blocks."""
    cells = cut(line(2000, 4))
    every = kelvin.blocks_of(cells)
    nodes = cells.mean.size - 1
    peak = cells.peak.view(Visited)
    peak.seen = set()
    barriers, sums, unwritten = kelvin.barriers_for(nodes), np.empty(kelvin.SUMS), kelvin.places_for(0)
    monkeypatch.setattr(kelvin, "_flown_over", kelvin._flown_over.py_func)
    kelvin.sweep_cells.py_func(cells._replace(peak=peak), every, barriers, 1e-5 * nodes, 1e-2, sums, unwritten)
    assert 0 < sums[kelvin.LENGTH] < 0.05 * nodes
    assert len(peak.seen) < 0.25 * nodes


LINE = {"length": 0.02, "points": 200, "rms_roughness": 5e-7, "shear_modulus": 1e7, "relaxation_time": 1e-3}


def block(model, parameters, columns, realisations, outputs):
    cases = len(next(iter(columns.values())))
    parameters = model.parameters.model_validate(parameters)
    return Block(parameters, columns, cases, realisations, 3, model.with_companions(outputs), 0.01)


@pytest.fixture
def transforms(monkeypatch):
    """Nodes of every inverse transform that makes heights or slopes."""
    counted = []
    whole = waves.series
    monkeypatch.setattr(waves, "series", lambda some, nodes: counted.append(nodes) or whole(some, nodes))
    return counted


def test_lines_and_transforms_of_a_block(transforms):
    """Forty cases on a line share it on each of its grids: heights and slopes, whatever the number of cases."""
    model = load("sliding_friction")
    force, velocity = (grid.ravel() for grid in np.meshgrid(np.geomspace(0.1, 10, 4), np.geomspace(1e-2, 10, 10)))
    numbers = LINE | {"normal_force": 1.0, "velocity": 1.0}
    columns = {"normal_force": force, "velocity": velocity}
    result = model.compute(block(model, numbers, columns, (0, 1, 2), ["friction_coefficient"]))
    assert result.solves == 3 * 40
    assert len(transforms) / 3 <= 8
    many = len(transforms)
    few = {name: column[:2] for name, column in columns.items()}
    model.compute(block(model, numbers, few, (0, 1, 2), ["friction_coefficient"]))
    assert many <= 2 * (len(transforms) - many)
    transforms.clear()
    model.compute(block(model, numbers | {"oversampling": 4}, columns, (0,), ["friction_coefficient"]))
    assert transforms == [400, 400, 800, 800]  # its own grid, and the coarser one that it is compared with


def test_cases_of_the_same_dimensionless_numbers_are_solved_once():
    """Load with modulus and velocity with time: one Deborah number and one load number."""
    model = load("sliding_friction")
    factor = np.array([1.0, 2.0, 3.0, 10.0])
    columns = {"normal_force": factor, "shear_modulus": 1e7 * factor, "velocity": 0.1 / factor}
    columns["relaxation_time"] = 1e-3 * factor
    numbers = LINE | {"normal_force": 1.0, "velocity": 0.1}
    result = model.compute(block(model, numbers, columns, (0, 1), ["friction_coefficient"]))
    assert result.solves == 2
    assert np.ptp(result.values["friction_coefficient"][:, 0]) == 0


@pytest.mark.parametrize(("rule", "solves"), [("exact", 2), ("limit", 2), ("fast", 8)])
def test_wear_is_followed_once_for_all_cycles(rule, solves):
    model = load("fretting_wear")
    stick, cycles = (grid.ravel() for grid in np.meshgrid([0.4, 0.6], [0.5, 1.0, 2.0, 4.0]))
    numbers = {"stick_radius": 0.5, "wear_rule": rule}
    columns = {"stick_radius": stick, "cycles": cycles}
    result = model.compute(block(model, numbers, columns, (0, 1, 2), ["wear_volume"]))
    assert result.solves == solves
    assert np.all(result.status == 1)


def test_films_of_the_same_numbers_are_solved_once():
    model = load("ehl_line")
    numbers = {"load_parameter": 1e-5, "speed_parameter": 1e-11, "material_parameter": 2500.0}
    columns = {"slide_roll_ratio": np.array([0.0, 0.1, 0.2]), "eyring_stress": np.full(3, 5e6)}
    result = model.compute(block(model, numbers, columns, (0, 1), ["central_film", "traction_coefficient"]))
    assert result.solves == 1
    assert np.ptp(result.values["central_film"]) == 0


def test_lines_of_a_block_of_jumps(transforms):
    """One line for all jumps, and the finer ones that it is compared with."""
    model = load("velocity_jump")
    columns = {"velocity": np.geomspace(0.01, 0.1, 5)}
    numbers = LINE | {"normal_force": 1.0, "velocity": 0.1, "relaxation_times": (0.0, 0.01, 0.1, 1.0)}
    result = model.compute(block(model, numbers, columns, (0,), ["friction_coefficient_jump"]))
    assert result.solves == 5
    assert len(transforms) <= 10


COMPILING = """
import sys
from collections import Counter
from numba.core.event import Listener, register

class Noting(Listener):
    counted = Counter()

    def on_start(self, event):
        self.counted[event.data["dispatcher"].py_func.__module__.split(".")[0]] += 1

    def on_end(self, event):
        pass

register("numba:compile", Noting())
from mdr_dask.cli import main

try:
    main(["run", "study.yaml", "--quiet", "--threads", "1"])
finally:
    print(Noting.counted["mdr_dask"], Noting.counted["numba"])
"""


@pytest.mark.slow
@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
def test_kernels_that_a_first_study_compiles(tmp_path):
    """Each takes a seventh of a second of processor time; and not one part of numba is among them."""
    (tmp_path / "study.yaml").write_text(SLIDING)
    empty = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    command = [sys.executable, "-P", "-c", COMPILING]
    found = subprocess.run(command, cwd=tmp_path, env=empty, capture_output=True, text=True, check=True)
    ours, of_numba = map(int, found.stdout.splitlines()[-1].split())
    assert ours <= 21
    assert of_numba == 0
