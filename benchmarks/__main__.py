"""Every benchmark by subject and kind.

python -m benchmarks                              what there is
python -m benchmarks friction                     all kinds of a subject, one after the other
python -m benchmarks friction honesty 500 89      one kind, with its own arguments
"""

import os
import runpy
import sys
from pathlib import Path

HERE = Path(__file__).parent
#: As in the runner's workers: a second thread that waits would count as time.
os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def kinds(subject):
    """Return the kinds of a subject: its modules that can be run."""
    modules = sorted((HERE / subject).glob("*.py"))
    return [path.stem for path in modules if '__name__ == "__main__"' in path.read_text()]


def subjects():
    """Return the kinds of every subject."""
    return {path.name: found for path in sorted(HERE.iterdir()) if path.is_dir() and (found := kinds(path.name))}


def main(subject=None, kind=None, *arguments):
    known = subjects()
    if subject is None:
        print("\n".join(f"{name}: {', '.join(found)}" for name, found in known.items()))
        return
    if subject not in known or (kind is not None and kind not in known[subject]):
        sys.exit(f"no benchmark {' '.join(filter(None, (subject, kind)))}; known: {known.get(subject, list(known))}")
    for each in known[subject] if kind is None else (kind,):
        print(f"# {subject} {each}", flush=True)
        sys.argv = [f"{subject} {each}", *arguments]
        runpy.run_module(f"benchmarks.{subject}.{each}", run_name="__main__")


if __name__ == "__main__":
    main(*sys.argv[1:])
