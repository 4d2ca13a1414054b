"""Look for cases that break a solver: ``python -m benchmarks stress search [MINUTES] [PART OF A NAME]``.

Runs every file of extremes again and again, each pass with other random examples, until the minutes are over; a pass
that has begun ends. What hypothesis finds it makes small and prints, with the line that repeats it, and keeps for the
next run of the tests. Exit code 1 if there is any.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = ("test_*stress*.py", "test_extremes*.py", "test_dimensions.py")


def files(part: str = "") -> list[str]:
    """Return the files of extremes whose name has a part."""
    found = {path for pattern in FILES for path in (ROOT / "tests").rglob(pattern)}
    return sorted(str(path.relative_to(ROOT)) for path in found if part in path.name)


def passed(seed: int, names: list[str]) -> bool:
    """Return whether one pass over files finds nothing."""
    options = ["-q", "-n0", "--no-header", "--tb=short", "--hypothesis-profile=search", f"--hypothesis-seed={seed}"]
    return subprocess.run([sys.executable, "-m", "pytest", *options, *names], cwd=ROOT, check=False).returncode == 0


def main(minutes: str = "10", part: str = "") -> None:
    names = files(part)
    if not names:
        sys.exit(f"no file of extremes has {part!r} in its name")
    end, seed, broken = time.monotonic() + 60 * float(minutes), time.time_ns() % 10**6, 0
    while True:
        print(f"# seed {seed}", flush=True)
        broken += not passed(seed, names)
        seed += 1
        if time.monotonic() > end:
            sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
