"""Files of strangers, made up by hypothesis: ``python -m benchmarks runner fuzz [EXAMPLES] [SEED] [KIND]``.

So many examples of every kind (campaigns, texts, runs, tables, cluster files, metadata, records, stores) are given to
the commands that read them. Told is what no such file may do: a traceback, a hang, something for the terminal, exit
code 3.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import fuzzing
import toy


def try_kind(kind: str, examples: int, start: int, whole: Path) -> Counter[str]:
    """Count the faults of a kind, each told once with the example that showed it first."""
    faults: Counter[str] = Counter()

    @seed(start)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(fuzzing.CASES[kind])
    def tell(case: fuzzing.Case) -> None:
        try:
            fuzzing.examine(case, whole)
        except Exception as error:
            said = str(error).strip() or type(error).__name__
            fault = said.splitlines()[-1].partition(": ")[2][-150:]
            if fault not in faults:
                print(ascii(f"{case!r:.600}"), ascii(said), sep="\n", flush=True)
            faults[fault] += 1

    tell()
    return faults


def main(examples: int = 500, start: int = 1, *kinds: str) -> None:
    toy.install()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        whole = fuzzing.sound_store(Path(folder))
        rows = []
        for kind in kinds or fuzzing.CASES:
            began = time.process_time()
            faults = try_kind(kind, examples, start, whole)
            rows.append(f"| {kind} | {examples} | {sum(faults.values())} | {time.process_time() - began:.0f} s |")
            print(rows[-1], flush=True)
    print("\n| kind | examples | faults | processors |\n|---|---|---|---|", *rows, sep="\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
