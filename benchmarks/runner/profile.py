"""Where the time of a run goes: ``python -m benchmarks runner profile [RESULTS]``.

Runs sliding friction into a store with the threads of this process and tells, in seconds of processor time, what was
spent in compiled kernels, in the rest of the model (lines by Fourier transform, arrays) and in everything else: plan,
Dask, Zarr, ledger, progress. Processor time is used because it does not count what other programs took meanwhile.
"""

from __future__ import annotations

import pkgutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any

from numba.core.registry import CPUDispatcher

from mdr_dask import models, physics
from mdr_dask.campaign import loads
from mdr_dask.execute import Resources, run

CAMPAIGN = """
name: profile
model: sliding_friction
seed: 1
realisations: {realisations}
parameters:
  length: 20 mm
  points: 5000
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: {{geometric: [1 mN, 100 N, 20]}}
  velocity: {{geometric: [0.1 mm/s, 100 m/s, 36]}}
outputs: [friction_coefficient]
"""
CASES = 20 * 36


class Clock:
    """Processor seconds inside the functions that it was put around, over all threads; inner calls count once."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._lock = threading.Lock()
        self._inside = threading.local()

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def timed(*arguments: Any, **named: Any) -> Any:
            if getattr(self._inside, "busy", False):
                return function(*arguments, **named)
            self._inside.busy = True
            start = time.thread_time()
            try:
                return function(*arguments, **named)
            finally:
                self._inside.busy = False
                with self._lock:
                    self.seconds += time.thread_time() - start

        return timed


def wrap_kernels(clock: Clock) -> None:
    """Put a clock around every compiled function that Python calls; compiled callers keep the original."""
    for found in pkgutil.iter_modules(physics.__path__):
        module = import_module(f"mdr_dask.physics.{found.name}")
        for name, value in list(vars(module).items()):
            if isinstance(value, CPUDispatcher):
                setattr(module, name, clock.around(value))


def main(results: int) -> None:
    realisations = max(1, round(results / CASES))
    with tempfile.TemporaryDirectory() as folder:
        warm = loads(CAMPAIGN.format(realisations=1), "warm.yaml", ".")
        run(warm, str(Path(folder, "warm.zarr")), Resources(), lambda _: None)
        kernels, model = Clock(), Clock()
        wrap_kernels(kernels)
        module = sys.modules["mdr_dask.models.sliding_friction"]
        loaded = models.load("sliding_friction")
        object.__setattr__(loaded, "compute", model.around(loaded.compute))
        assert module.MODEL is loaded
        study = loads(CAMPAIGN.format(realisations=realisations), "profile.yaml", ".")
        wall, processor = time.perf_counter(), time.process_time()
        progress = run(study, str(Path(folder, "study.zarr")), Resources(), lambda _: None)
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{progress.done} results in {progress.blocks} blocks, {wall:.1f} s wall, {processor:.1f} s of processors")
    parts = {
        "kernels": kernels.seconds,
        "rest of the model": model.seconds - kernels.seconds,
        "runner": processor - model.seconds,
    }
    for name, seconds in parts.items():
        print(f"{name:20s} {seconds:8.2f} s  {100 * seconds / processor:5.1f} %")
    print(f"runner, a block      {1e3 * parts['runner'] / progress.blocks:8.2f} ms")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
