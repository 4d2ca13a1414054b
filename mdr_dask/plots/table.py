"""The table of a figure: all that is drawn in it, as a CSV file that says where it comes from."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mdr_dask import store as stores
from mdr_dask.errors import DataError
from mdr_dask.plots import page, style
from mdr_dask.version import __version__

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar

#: Points to an inch of a picture, and of one whose printed size was asked for.
DPI, PRINTED_DPI = 150, 300
#: Columns of a table before and after those of the parameters.
FIRST = ("panel", "curve", "what")
LAST = tuple(f"{name}{end}" for name in ("x", "y", "value") for end in ("", "_low", "_high"))


class Rows(NamedTuple):
    """What one curve, law or map adds to a table.

    Attributes
    ----------
    axes : Axes
        The panel.
    columns : dict
        Of equal length; words that all points share stand alone.
    units : dict of str to str
        Of the parameters.
    label : str
        Entry in the legend, as matplotlib writes it.
    artist : Artist
        What draws it.
    """

    axes: Axes
    columns: dict[str, Any]
    units: dict[str, str]
    label: str
    artist: Artist


class Bar(NamedTuple):
    """A colour bar, and the panels that it stands beside."""

    drawn: Colorbar
    panels: list[Axes]


class Drawn(Figure):
    """A figure that keeps what is drawn in it, and knows its origin; a notebook shows it at the end of a cell."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.rows: list[Rows] = []
        self.bars: list[Bar] = []
        self.origin: Mapping[str, str] = {}

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()

    def save(self, path: str | Path) -> None:
        """Write the figure, and its table beside it: ``mu.pdf`` and ``mu.csv``.

        Raises
        ------
        DataError
            If a table stands there that is of no figure.
        """
        beside = table_beside(path)
        save_picture(self, Path(path))
        save_table(self, beside, self.origin)

    def colorbar(self, mappable: Any, *arguments: Any, **options: Any) -> Colorbar:
        """Draw a colour bar, as any figure does."""
        beside: Any = options.get("ax", getattr(mappable, "axes", None))
        bar = super().colorbar(mappable, *arguments, **options)
        self.bars.append(Bar(bar, list(beside) if isinstance(beside, Iterable) else [beside]))
        return bar

    def write_down(
        self, artist: Artist, what: str, label: str, parameters: Mapping[str, xr.DataArray], columns: Mapping[str, Any]
    ) -> None:
        """Add points to the table; those without a value are none, but for the marks of cases that have none."""
        drawn = next((columns[name] for name in ("value", "y", "y_low") if name in columns), columns["x"])
        known = np.isfinite(drawn)
        named = {f"parameter {name}" if name in (*FIRST, *LAST) else name: each for name, each in parameters.items()}
        along = {
            name: np.broadcast_to(_plain(np.ravel(each.values)), known.shape)[known] for name, each in named.items()
        }
        shown = {name: np.broadcast_to(column, known.shape)[known] for name, column in columns.items()}
        units = {name: str(each.attrs.get("units", "1")) for name, each in named.items()}
        words = {"curve": style.plain(label), "what": style.plain(what)}
        axes = cast("Axes", artist.axes)
        self.rows.append(Rows(axes, {**words, **along, **shown}, units, label, artist))

    def panels(self) -> list[Axes]:
        """Return the panels in which anything is drawn, as the table counts them."""
        return list(dict.fromkeys(each.axes for each in self.rows))

    def table(self) -> pd.DataFrame:
        """Return all that is drawn, a row for every point: parameters in SI, what stands on the axes as it is shown.

        Parameters that are the same everywhere stand in ``attrs["held"]``, units of all in ``attrs["units"]``.
        """
        number = {axes: k + 1 for k, axes in enumerate(self.panels())}
        frames = [pd.DataFrame({"panel": number[each.axes], **each.columns}) for each in self.rows]
        frames = [frame.dropna(axis=1, how="all") for frame in frames if len(frame)]
        whole = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()
        parameters = [name for name in whole if name not in (*FIRST, *LAST)]
        held = {name: whole[name].iloc[0] for name in parameters if (whole[name] == whole[name].iloc[0]).all()}
        ends = [name for name in LAST if name in whole or name in ("x", "y")]
        shown = whole.reindex(columns=[*FIRST, *(name for name in parameters if name not in held), *ends])
        shown.attrs = {"held": held, "units": {name: unit for each in self.rows for name, unit in each.units.items()}}
        return shown


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    return values if values.dtype.kind in "fiub" else np.array([style.plain(str(value)) for value in values])


def provenance(name: str, urls: Sequence[str], command: str) -> dict[str, str]:
    """Return what the table of a figure says of its origin."""
    told = {"mdr_dask": f"{__version__}, figure {name}", "command": command}
    return told | {f"store {url}": _campaign_of(stores.attributes(url)) for url in urls}


def of_groups(name: str, groups: Mapping[str, xr.Dataset]) -> dict[str, str]:
    """Return what the table of a figure says of its origin where no command drew it."""
    campaigns = dict.fromkeys(_campaign_of(data.attrs) for data in groups.values())
    return {"mdr_dask": f"{__version__}, figure {name}", "study": "; ".join(campaigns)}


def _campaign_of(held: Mapping[Any, Any]) -> str:
    """Return which campaign a study is of, by its attributes."""
    title, text, model, version = (str(held.get(key)) for key in ("title", "campaign", "model", "model_version"))
    digest, computed = hashlib.sha256(text.encode()).hexdigest(), held.get("versions", {}).get("mdr_dask")
    return f"campaign {title}, sha256 {digest}, model {model} version {version}, computed by mdr_dask {computed}"


def table_beside(path: str | Path) -> Path:
    """Return the place of the table of a figure; DataError if a table that is of no figure stands there."""
    beside = Path(path).with_suffix(".csv")
    if beside.exists() and not beside.read_bytes().startswith(b"# mdr_dask"):
        raise DataError(f"{beside}: a table that is of no figure stands there; give the figure another name")
    return beside


def save_picture(figure: Figure, path: Path) -> None:
    """Write a figure: finer where its printed size was asked for."""
    figure.savefig(path, dpi=DPI if page.asked().width is None else PRINTED_DPI)


def save_table(figure: Drawn, path: Path, provenance: Mapping[str, str]) -> None:
    """Write the table of a figure, for ``pandas.read_csv(comment="#")``."""
    table = figure.table()
    with path.open("w", encoding="utf-8", newline="") as stream:
        stream.writelines(f"# {line}\n" for line in head(figure, table, provenance))
        table.to_csv(stream, index=False, lineterminator="\n")


def _number(value: Any) -> str:
    return str(value) if isinstance(value, str) else f"{value:.12g}"


def head(figure: Drawn, table: pd.DataFrame, provenance: Mapping[str, str]) -> list[str]:
    """Return what a table says of itself: its origin, what is held fixed, and what stands on the axes of each panel."""
    units = table.attrs["units"]
    held = {name: f"{_number(value)} {units[name]}".removesuffix(" 1") for name, value in table.attrs["held"].items()}
    varied = [name for name in table if name in units]
    lines = [f"{name}: {text}" for name, text in provenance.items()]
    lines.append(f"title: {figure.get_suptitle()}")
    lines += [f"not drawn: {style.left_out(figure)}"] * bool(style.left_out(figure))
    lines += [f"held fixed: {', '.join(f'{name} = {value}' for name, value in held.items())}"] * bool(held)
    lines += [f"units: {', '.join(f'{name} [{units[name]}]' for name in varied)}"] * bool(varied)
    for number, axes in enumerate(figure.panels()):
        parts = [f"x: {axes.get_xlabel()}", f"y: {axes.get_ylabel()}", axes.get_title()]
        lines.append(f"panel {number + 1}: {'; '.join(part for part in parts if part)}")
    return [style.plain(line) for line in lines]
