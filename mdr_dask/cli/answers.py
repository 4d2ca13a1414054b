"""Print the table that answers a question, or write it to a file, row by row."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from mdr_dask.cli.options import tell
from mdr_dask.cli.printing import ROUNDING, print_aligned, print_left, titled, with_error, with_interval
from mdr_dask.cli.writing import require_suffix, writing
from mdr_dask.errors import DataError

if TYPE_CHECKING:
    import pandas as pd

    from mdr_dask.questions.table import Table

#: Without a limit, an aligned table is printed in pieces of about this number of rows.
AT_ONCE = 2**16
FILES = (".csv", ".json", ".jsonl", ".parquet", ".nc", ".zarr")


def print_answer(answer: Table, form: str, limit: int, join: bool) -> None:
    """Print a table in aligned columns with at most `limit` rows, or all rows as CSV, JSON or one JSON object per line.

    If `join` is true, each mean and its errors are printed in one column.
    """
    if form == "table":
        _print_aligned(answer, limit, join)
    else:
        _write_text(answer, form, sys.stdout)


def write_answer(answer: Table, path: Path) -> int:
    """Write a table to a file in the format of the suffix of `path`, and return the number of rows."""
    rows = 0

    def counted() -> Iterator[pd.DataFrame]:
        nonlocal rows
        for frame in answer.frames:
            rows += len(frame)
            yield frame

    counting = replace(answer, frames=counted())
    with writing(path):
        if path.suffix == ".parquet":
            _write_parquet(counting, path)
        else:
            with path.open("w", encoding="utf-8", newline="") as stream:
                _write_text(counting, path.suffix[1:], stream)
    return rows


def check_target(path: Path) -> None:
    """Raise an error if the suffix of a path is unknown, if a store is at this path, or if pyarrow is missing."""
    from mdr_dask.store import is_study

    require_suffix(path, FILES)
    if path.suffix == ".zarr" and is_study(str(path)):
        raise click.UsageError(f"expected a new file, got the store of a study: {str(path)!r}")
    if path.suffix == ".parquet":
        _pyarrow()


def _print_aligned(answer: Table, limit: int, join: bool) -> None:
    import pandas as pd

    waiting: list[pd.DataFrame] = []
    count, printed = 0, False
    for frame in answer.frames:
        waiting.append(frame)
        count += len(frame)
        if count >= (limit or AT_ONCE):
            whole = pd.concat(waiting, ignore_index=True)
            _print_frame(whole[:limit] if limit else whole, answer, join)
            if limit:
                more = count > limit or next(answer.frames, None) is not None
                print_left(answer.total - limit if answer.total is not None else None if more else 0)
                return
            waiting, count, printed = [], 0, True
    if waiting:
        _print_frame(pd.concat(waiting, ignore_index=True), answer, join)
    elif not printed:
        tell("no rows")


def _print_frame(frame: pd.DataFrame, answer: Table, join: bool) -> None:
    columns = {str(name): frame[name].tolist() for name in frame}
    note = ""
    if join:
        columns, note = _joined(columns)
    units = answer.units
    titles = [titled(name, units[name] if name in units else units[f"{name}_mean"]) for name in columns]
    print_aligned(titles, list(columns.values()), answer.keys, note)


def _joined(columns: dict[str, list[Any]]) -> tuple[dict[str, list[Any]], str]:
    """Join each mean with its errors (``0.1234 +- 0.0005``) or its interval (``0.1234 (0.1220, 0.1240)``).

    Errors that are unknown or zero in all rows are left out. Also return a text that names the printed errors.
    """
    known = {name for name, values in columns.items() if any(map(_is_known, values))}
    joined: dict[str, list[Any]] = {}
    left_out: set[str] = set()
    kinds: dict[str, tuple[str, ...]] = {}
    for name, values in columns.items():
        output = name.removesuffix("_mean")
        if output != name:
            errors = [f"{output}_{part}" for part in ("standard_error", "grid_error") if f"{output}_{part}" in columns]
            ends = [f"{output}_{part}" for part in ("low", "high") if f"{output}_{part}" in columns]
            left_out |= {*errors, *ends}
            parts = [each for each in ends if each in known]
            parts += [each for each in errors if _is_shown(columns[each], values)]
            join = with_interval if ends else with_error
            joined[output] = [join(*each) for each in zip(values, *(columns[part] for part in parts), strict=True)]
            if errors and parts:
                kinds[output] = tuple(f" +- {part.removeprefix(f'{output}_').replace('_', ' ')}" for part in parts)
            elif parts:
                kinds[output] = (" (95 % interval)",)
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
    return any(error > ROUNDING * abs(mean) for error, mean in zip(errors, means, strict=True))


def _is_known(value: Any) -> bool:
    return not (value is None or (isinstance(value, float) and math.isnan(value)))


def _write_text(answer: Table, form: str, stream: TextIO) -> None:
    if form == "csv":
        titles = [titled(name, unit) for name, unit in answer.units.items()]
        stream.write(_frame(answer).set_axis(titles, axis=1).to_csv(index=False, lineterminator="\n"))
        for frame in answer.frames:
            frame.to_csv(stream, header=False, index=False, na_rep="nan", lineterminator="\n")
        return
    if form == "json":
        stream.write(f'{{"units": {json.dumps(answer.units)}, "rows": [')
    before = "\n" if form == "json" else ""
    for frame in answer.frames:
        lines = _json_lines(frame)
        if form == "json":
            stream.write(before + ",\n".join(lines))
            before = ",\n"
        else:
            stream.writelines(f"{line}\n" for line in lines)
    if form == "json":
        stream.write("\n]}\n")


def _frame(answer: Table) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(columns=list(answer.units))


def _json_lines(frame: pd.DataFrame) -> Iterator[str]:
    template = "{" + ", ".join(json.dumps(str(name)).replace("%", "%%") + ": %s" for name in frame) + "}"
    return (template % values for values in zip(*(_json_texts(frame[name].tolist()) for name in frame), strict=True))


def _json_texts(values: Sequence[Any]) -> list[str]:
    if values and isinstance(values[0], float):
        return [repr(value) if math.isfinite(value) else "null" for value in values]
    texts = {value: json.dumps(value) for value in set(values)}
    return [texts[value] for value in values]


def _pyarrow() -> Any:
    try:
        import pyarrow.parquet
    except ImportError:
        raise DataError("writing .parquet needs pyarrow: pip install 'mdr_dask[parquet]'") from None
    return pyarrow


def _write_parquet(answer: Table, path: Path) -> None:
    """Write a Parquet file with one row group for each frame, and the unit of each column in its metadata."""
    arrow = _pyarrow()
    first = next(answer.frames, _frame(answer))
    schema = arrow.Schema.from_pandas(first, preserve_index=False).remove_metadata()
    for index, name in enumerate(schema.names):
        schema = schema.set(index, schema.field(name).with_metadata({"units": answer.units[name]}))
    with arrow.parquet.ParquetWriter(path, schema) as writer:
        for frame in chain([first], answer.frames):
            writer.write_table(arrow.Table.from_pandas(frame, schema, preserve_index=False))
