"""Print the table that answers a question, or write it to a file, row by row."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from mdr_dask.cli.options import tell
from mdr_dask.cli.printing import finite, is_rounding, print_aligned, print_left, titled, with_error
from mdr_dask.cli.writing import require_suffix, writing

if TYPE_CHECKING:
    import pandas as pd

    from mdr_dask.questions.table import Table

FILES = (".csv", ".json", ".nc", ".zarr")


def print_answer(answer: Table, form: str, limit: int, join: bool) -> None:
    """Print a table in aligned columns with at most `limit` rows, or all rows as CSV or JSON.

    A `limit` of 0 means all rows. If `join` is true, an aligned column contains a mean together with its errors.
    """
    if form == "table":
        _print_aligned(answer, limit, join)
    else:
        _write_text(answer, form, sys.stdout)


def write_answer(answer: Table, path: Path) -> int:
    """Write a table to a ``.csv`` or ``.json`` file, in the format of its suffix, and return the number of rows."""
    rows = 0

    def counted() -> Iterator[pd.DataFrame]:
        nonlocal rows
        for frame in answer.frames:
            rows += len(frame)
            yield frame

    counting = replace(answer, frames=counted())
    with writing(path), path.open("w", encoding="utf-8", newline="") as stream:
        _write_text(counting, path.suffix[1:], stream)
    return rows


def check_target(path: Path) -> None:
    """Raise UsageError if the suffix of a path is unknown, or if a store is at this path."""
    from mdr_dask.store import is_study

    require_suffix(path, FILES)
    if path.suffix == ".zarr" and is_study(str(path)):
        raise click.UsageError(f"expected a new file, got the store of a study: {str(path)!r}")


def _print_aligned(answer: Table, limit: int, join: bool) -> None:
    import pandas as pd

    frames: list[pd.DataFrame] = []
    count = 0
    for frame in answer.frames:
        frames.append(frame)
        count += len(frame)
        if 0 < limit <= count:
            break
    if not frames:
        tell("no rows")
        return
    whole = pd.concat(frames, ignore_index=True)
    _print_frame(whole[:limit] if limit else whole, answer, join)
    if 0 < limit <= count:
        more = count > limit or next(answer.frames, None) is not None
        print_left(answer.total - limit if answer.total is not None else None if more else 0)


def _print_frame(frame: pd.DataFrame, answer: Table, join: bool) -> None:
    from mdr_dask.aggregation import BIASED

    columns = {str(name): frame[name].tolist() for name in frame}
    note = ""
    if join:
        columns, note = _joined(columns)
        states = zip(columns.get("status", []), columns.get("realisations", []), strict=False)
        if any("failed" in state and count for state, count in states):
            note = "; ".join(filter(None, [note, f"failed realisations: {BIASED}"]))
    units = answer.units
    titles = [titled(name, units[name] if name in units else units[f"{name}_mean"]) for name in columns]
    print_aligned(titles, list(columns.values()), answer.keys, note)


def _joined(columns: dict[str, list[Any]]) -> tuple[dict[str, list[Any]], str]:
    """Join each mean with its errors, as in ``0.1234 +- 0.0005``, and also return a text that names the printed errors.

    The errors of an output are left out if they are unknown, zero or rounding errors in all rows.
    """
    joined: dict[str, list[Any]] = {}
    left_out: set[str] = set()
    kinds: dict[str, tuple[str, ...]] = {}
    for name, values in columns.items():
        output = name.removesuffix("_mean")
        if output != name:
            errors = [f"{output}_{part}" for part in ("standard_error", "grid_error") if f"{output}_{part}" in columns]
            left_out |= {*errors}
            shown = [each for each in errors if _is_shown(columns[each], values)]
            joined[output] = [
                with_error(*each) for each in zip(values, *(columns[part] for part in shown), strict=True)
            ]
            if shown:
                kinds[output] = tuple(f" +- {part.removeprefix(f'{output}_').replace('_', ' ')}" for part in shown)
        elif name not in left_out:
            joined[name] = values
    return joined, _meaning(kinds)


def _meaning(kinds: dict[str, tuple[str, ...]]) -> str:
    """Return a text that names the printed errors, once for all outputs if possible, otherwise for each output."""
    longest = max(kinds.values(), key=len, default=())
    if all(longest[: len(kind)] == kind for kind in kinds.values()):
        return f"mean{''.join(longest)}" if longest else ""
    return "; ".join(f"{output}{''.join(kind)}" for output, kind in kinds.items())


def _is_shown(errors: Sequence[float], means: Sequence[float]) -> bool:
    return any(error > 0 and not is_rounding(error, mean) for error, mean in zip(errors, means, strict=True))


def _write_text(answer: Table, form: str, stream: TextIO) -> None:
    if form == "csv":
        csv.writer(stream, lineterminator="\n").writerow(titled(name, unit) for name, unit in answer.units.items())
        for frame in answer.frames:
            frame.to_csv(stream, header=False, index=False, na_rep="nan", lineterminator="\n")
        return
    stream.write(f'{{"units": {json.dumps(answer.units)}, "rows": [')
    before = "\n"
    for frame in answer.frames:
        rows = zip(*(frame[name].tolist() for name in frame), strict=True)
        documents = ({name: finite(value) for name, value in zip(frame, row, strict=True)} for row in rows)
        stream.write(before + ",\n".join(map(json.dumps, documents)))
        before = ",\n"
    stream.write("\n]}\n")
