"""One study, computed by our runner and by other programs; `compare` starts each program in its own process.

A case is the friction of one rough line at one speed. All programs call the same function, case by case, in forty equal
blocks on two cores, and are used as their manuals recommend. A second run computes the missing results.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from mdr_dask.models.base import Model, Output, Parameters, quantity
from mdr_dask.models.per_case import per_case
from mdr_dask.physics.sliding.steady import steady_sliding
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.surfaces.waves import Waves

SPEEDS, HALVES = 20, 2
BLOCKS = SPEEDS * HALVES
MODES, POINTS, LOAD = 500, 2000, 0.5


@cache
def tally() -> int:
    """Return the file to which each computed case appends a byte, so that the count survives a killed process."""
    return os.open(os.environ["PEERS_TALLY"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)


def friction(speed: int, line: int) -> float:
    """Return the coefficient of friction of one case, with heights in units of the rms roughness."""
    amplitude, phase = roughness.amplitudes(MODES, hurst=0.7), roughness.phases(1, int(line), MODES)
    waves = Waves(0.5 * amplitude * np.exp(1j * phase), 2 * MODES)
    deborah = np.array([10.0 ** (-5 + 4 * int(speed) / (SPEEDS - 1))])
    found = steady_sliding(periodic_line(waves.heights(POINTS), waves.slopes(POINTS)), deborah, np.array([LOAD]))
    os.write(tally(), b".")
    return float(found.drag[0]) / LOAD


@dataclass(frozen=True)
class Study:
    """A study: its folder, and the number of lines at every speed."""

    folder: Path
    lines: int

    @property
    def axes(self) -> dict[str, list[int]]:
        return {"speed": list(range(SPEEDS)), "line": list(range(self.lines))}

    @property
    def block_size(self) -> int:
        return self.lines // HALVES

    def empty(self) -> np.ndarray:
        return np.full((SPEEDS, self.lines), np.nan)

    def region(self, block: int) -> tuple[int, slice]:
        """Return the speed and the lines of a block."""
        speed, half = divmod(block, HALVES)
        return speed, slice(half * self.block_size, (half + 1) * self.block_size)

    def block(self, number: int) -> np.ndarray:
        """Return the results of a block."""
        speed, lines = self.region(number)
        return np.array([friction(speed, line) for line in range(lines.start, lines.stop)])


def run_loop(study: Study) -> None:
    results = [study.block(number) for number in range(BLOCKS)]
    np.save(study.folder / "all.npy", np.reshape(results, (SPEEDS, study.lines)))


def read_loop(study: Study) -> np.ndarray:
    path = study.folder / "all.npy"
    return np.load(path) if path.exists() else study.empty()


def save_block(study: Study, number: int) -> None:
    np.savez(study.folder / f"{number}.npz", friction=study.block(number))


def run_joblib(study: Study) -> None:
    from joblib import Parallel, delayed

    missing = [number for number in range(BLOCKS) if not (study.folder / f"{number}.npz").exists()]
    Parallel(n_jobs=2)(delayed(save_block)(study, number) for number in missing)


def read_blocks(study: Study) -> np.ndarray:
    found = study.empty()
    for path in study.folder.glob("*.npz"):
        found[study.region(int(path.stem))] = np.load(path)["friction"]
    return found


def run_dask(study: Study) -> None:
    import dask.array
    import xarray as xr

    path = study.folder / "study.zarr"
    if not path.exists():
        values = dask.array.full((SPEEDS, study.lines), np.nan, chunks=(1, study.block_size))
        layout = xr.Dataset({"friction": (tuple(study.axes), values)}, study.axes)
        layout.to_zarr(path, compute=False)

    @dask.delayed
    def write(number: int) -> None:
        speed, lines = study.region(number)
        found = xr.Dataset({"friction": (tuple(study.axes), study.block(number)[None])})
        found.to_zarr(path, region={"speed": slice(speed, speed + 1), "line": lines})

    done = np.isfinite(read_dask(study))
    missing = [number for number in range(BLOCKS) if not done[study.region(number)].all()]
    dask.compute(*[write(number) for number in missing], scheduler="threads", num_workers=2)


def read_dask(study: Study) -> np.ndarray:
    import xarray as xr

    return xr.open_zarr(study.folder / "study.zarr").friction.values


def crop(study: Study) -> Any:
    import xyzpy

    runner = xyzpy.Runner(friction, var_names=["friction"])
    return runner.Crop(name="peers", parent_dir=str(study.folder), batchsize=study.block_size)


def run_xyzpy(study: Study) -> None:
    sown = crop(study)
    if not sown.is_prepared():
        sown.sow_combos(study.axes, verbosity=0)
    sown.grow_missing(parallel=True, num_workers=2, verbosity=0)
    sown.reap(verbosity=0).to_netcdf(study.folder / "all.nc", engine="h5netcdf")


def read_xyzpy(study: Study) -> np.ndarray:
    import xarray as xr

    path = study.folder / "all.nc"
    found = xr.load_dataset(path) if path.exists() else crop(study).reap(allow_incomplete=True, clean_up=False)
    return found.friction.transpose(*study.axes).values


def run_pipefunc(study: Study) -> None:
    from concurrent.futures import ProcessPoolExecutor

    from pipefunc import Pipeline, pipefunc

    mapped = pipefunc("friction", mapspec="speed[i], line[j] -> friction[i, j]")(friction)
    with ProcessPoolExecutor(2) as pool:
        Pipeline([mapped]).map(
            study.axes,
            run_folder=study.folder / "run",
            executor=pool,
            chunksizes=study.block_size,
            resume=True,
            return_results=False,
            show_progress=False,
        )


def read_pipefunc(study: Study) -> np.ndarray:
    from pipefunc.map import load_outputs

    found = load_outputs("friction", run_folder=study.folder / "run")
    return np.ma.filled(np.ma.asarray(found).astype(float), np.nan)


class Case(Parameters):
    """A case: the numbers of its line and its speed."""

    speed: int = quantity("1", "number of the speed", ge=0)
    line: int = quantity("1", "number of the line", ge=0)


MODEL = Model(
    name="peers",
    version=1,
    summary="the same function for all",
    parameters=Case,
    outputs=(Output("friction", "1", "coefficient of friction"),),
    compute=per_case(lambda case, _: {"friction": friction(case.speed, case.line)}),
    operations=lambda block: 5e5 * block.cases,
)
CAMPAIGN = """
name: peers
model: benchmarks.runner.ways:MODEL
realisations: 1
parameters: {axes}
store: {{blocks: {{speed: 1, line: {block_size}}}}}
"""


def run_ours(study: Study, kind: str = "threads") -> None:
    from mdr_dask.campaign import loads
    from mdr_dask.execute import Resources, run

    campaign = loads(CAMPAIGN.format(axes=study.axes, block_size=study.block_size), "peers.yaml", ".")
    run(campaign, str(study.folder / "study.zarr"), Resources(**{kind: 2}), lambda _: None)


def read_ours(study: Study) -> np.ndarray:
    from mdr_dask import store

    return store.datasets(str(study.folder / "study.zarr"))[""].friction.values.reshape(SPEEDS, study.lines)


@dataclass(frozen=True)
class Way:
    """One program: a function that computes the study, and a function that reads its results."""

    run: Callable[[Study], None]
    read: Callable[[Study], np.ndarray]


WAYS = {
    "bare loop": Way(run_loop, read_loop),
    "mdr_dask": Way(run_ours, read_ours),
    "mdr_dask, processes": Way(partial(run_ours, kind="workers"), read_ours),
    "joblib to npz": Way(run_joblib, read_blocks),
    "dask.delayed, to_zarr(region)": Way(run_dask, read_dask),
    "xyzpy": Way(run_xyzpy, read_xyzpy),
    "pipefunc": Way(run_pipefunc, read_pipefunc),
}


def main(act: str, folder: str, lines: str, way: str) -> None:
    """Run a program in a folder, or write the results in this folder to a file."""
    study = Study(Path(folder), int(lines))
    if act == "run":
        WAYS[way].run(study)
    else:
        np.save(study.folder.with_suffix(".read.npy"), WAYS[way].read(study))


if __name__ == "__main__":
    from benchmarks.runner import ways  # workers must find pickled functions by this module name

    ways.main(*sys.argv[1:])
