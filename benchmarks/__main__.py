"""All benchmarks: ``python -m benchmarks KIND [ARGUMENTS]``; without a kind, a list of the kinds."""

import importlib
import os
import sys

# one thread for linear algebra, as in the workers of a run, because waiting threads would count as processor time
os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

#: Kinds by name, with the module whose `main` runs the benchmark, and a one-line description.
KINDS = {
    "accuracy": ("benchmarks.accuracy", "error, time and stated errors of every solver: docs/accuracy-and-speed.md"),
    "campaigns": ("benchmarks.campaigns", "error and time of whole campaigns that request an accuracy"),
    "peers": ("benchmarks.peers", "solvers compared with other programs: docs/comparison.md"),
    "runner": ("benchmarks.runner.compare", "runs compared with joblib, dask, xyzpy and pipefunc, also after a kill"),
    "validity": ("benchmarks.surfaces.validity", "the method compared with a half-space: docs/validity.md"),
    "persson": ("benchmarks.surfaces.persson", "friction of lines compared with Persson's theory: docs/validity.md"),
    "road": ("benchmarks.surfaces.road", "the generated road of campaigns/road.yaml"),
    "high_speed": ("benchmarks.high_speed", "friction at very high velocity: docs/high-speed.md"),
    "thesis": ("benchmarks.thesis.page", "the thesis, claim by claim: docs/thesis.md"),
}


def main(kind: str = "", *arguments: str) -> None:
    """Run one kind of benchmark, or print the list of kinds."""
    if kind in KINDS:
        importlib.import_module(KINDS[kind][0]).main(*arguments)
    else:
        known = "\n".join(f"{name:18} {about}" for name, (_, about) in KINDS.items())
        sys.exit(f"no benchmark {kind}; known:\n{known}" if kind else known)


if __name__ == "__main__":
    main(*sys.argv[1:])
