"""Run tests of every solver as other machines would: ``python -m benchmarks stress machines [PART OF A NAME]``.

Without a compiler, with every index checked, with the vector unit of another processor, with the BLAS of others, and
with other numbers of threads. Exit code 1 if a test fails on any of them.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Solvers against closed forms and references that share no code with them: a few seconds, once compiled.
SOLVERS = (
    *("surfaces/test_cubic_line.py", "surfaces/test_shapes.py", "mdr", "wear/test_rules.py", "test_solids.py"),
    *("sliding/test_displacement.py", "sliding/test_patches.py", "transients/test_contact_search.py"),
    *("lubrication/test_newton.py", "lubrication/test_oil.py", "superposition/test_least_squares.py"),
)
#: What takes minutes where nothing is compiled, or each kernel is compiled anew.
SHORT = tuple(name for name in SOLVERS if not re.search("wear|superposition|newton|patches|solids", name))
MACHINES: dict[str, tuple[dict[str, str], tuple[str, ...]]] = {
    "nothing compiled": ({"NUMBA_DISABLE_JIT": "1"}, SHORT),
    "every index checked": ({"NUMBA_BOUNDSCHECK": "1"}, SHORT),
    "oldest vector unit": ({"NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": "+sse2"}, SHORT),
    "BLAS of Nehalem, one thread": ({"OPENBLAS_CORETYPE": "Nehalem", "OPENBLAS_NUM_THREADS": "1"}, SOLVERS),
    "BLAS of Haswell, two threads": ({"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "2"}, SOLVERS),
    "BLAS of Skylake, eight threads": ({"OPENBLAS_CORETYPE": "SkylakeX", "OPENBLAS_NUM_THREADS": "8"}, SOLVERS),
}


def passed(changed: dict[str, str], names: tuple[str, ...]) -> tuple[bool, str]:
    """Return whether tests pass in an environment, and what pytest told; other kernels are compiled for themselves."""
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "--no-header", "--tb=line", "-p", "no:cacheprovider"]
    with tempfile.TemporaryDirectory(prefix="kernels-") as kernels:
        own = {"NUMBA_CACHE_DIR": kernels} if any(name.startswith("NUMBA") for name in changed) else {}
        paths = [f"tests/physics/{name}" for name in names]
        environment = os.environ | changed | own
        done = subprocess.run(
            [*command, *paths], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
        )
    return done.returncode == 0, done.stdout.splitlines()[-1] if done.returncode == 0 else done.stdout + done.stderr


def main(part: str = "") -> None:
    results = {}
    for name, (changed, tests) in MACHINES.items():
        if part in name:
            results[name], told = passed(changed, tests)
            print(f"{name} ({', '.join(f'{key}={value}' for key, value in changed.items())}): {told}", flush=True)
    if not results:
        sys.exit(f"no machine has {part!r} in its name; known: {', '.join(MACHINES)}")
    sys.exit(0 if all(results.values()) else 1)


if __name__ == "__main__":
    main(*sys.argv[1:])
