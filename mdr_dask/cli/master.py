"""The command `master-curve`: merge the curves of a store or a table."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.options import csv_option, figure_options, json_option, select_option, series_option, tell
from mdr_dask.cli.printing import print_json, print_rows, table, titled
from mdr_dask.cli.writing import require_suffix, writing
from mdr_dask.errors import DataError
from mdr_dask.version import __version__

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from mdr_dask.physics.superposition.master_curve import Vertical


PARTS = ("factors", "curve", "points")
"""Parts of the result that can be printed: shift factors, the merged curve with its error, or all shifted points."""


@click.command("master-curve")
@click.argument("source")
@series_option
@select_option
@click.option("--over", help="Abscissa of the curves: a column such as normal_force or time.")
@click.option(
    "--of",
    "ordinates",
    multiple=True,
    help="Ordinate: a column such as friction_coefficient or modulus. Give it twice for storage and loss modulus.",
)
@click.option("--by", help="Quantity in which the curves differ: a column such as velocity or temperature.")
@click.option(
    "--vertical",
    type=click.Choice(["none", "modulus", "compliance", "free"]),
    help="Vertical factors of the curves. modulus or compliance: the known factor b_T and an unknown offset of a few "
    "per cent (the default for these quantities); free: unknown factors; none: no factors.",
)
@click.option(
    "--reference",
    type=float,
    help="Value of --by at which log10 of the factors is 0, in the unit of --by. It may lie between measured values.",
)
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), help="Write the table that --show selects to FILE.csv."
)
@figure_options("--plot")
@click.option("--show", "part", type=click.Choice(PARTS), default=PARTS[0], show_default=True, help="What to print.")
@json_option
@csv_option
def master_curve(
    source: str,
    series: str | None,
    selections: tuple[str, ...],
    over: str | None,
    ordinates: tuple[str, ...],
    by: str | None,
    vertical: Vertical | None,
    reference: float | None,
    output: Path | None,
    figure: Path | None,
    look: dict[str, Any],
    part: str,
    form: str | None,
) -> None:
    """Shift the curves of a store or a table into one master curve; print the factors, their errors and fitted laws.

    SOURCE is a store, a table, or '-' for a table from standard input. A table has a row of names, and may have one of
    units. The storage and loss modulus of a test are shifted together, unless --of names only one modulus.

    \b
    mdr-dask master-curve results/force_master_curve.zarr --plot master.png
    mdr-dask master-curve relaxation.csv --by T --reference 20 -o factors.csv
    mdr-dask master-curve relaxation.csv --by T --reference 60 --show curve --csv
    """
    require_suffix(output, (".csv",))
    from mdr_dask.fits.master_curve import master_curve as superpose

    curve = superpose(_open(source, series, selections), over, ordinates or None, by, vertical, reference)
    if output is not None:
        with writing(output), output.open("w") as stream, contextlib.redirect_stdout(stream):
            _print_table(curve, part, "csv")
    if figure is not None:
        from mdr_dask.cli.figures import save
        from mdr_dask.plots.master_curve import draw_master_curve

        origin = {"mdr_dask": f"{__version__}, master-curve", "source": source}
        save(lambda: draw_master_curve(curve), figure, origin, look)
    _print(curve, part, form)


def _open(source: str, series: str | None, selections: tuple[str, ...]) -> xr.Dataset | pd.DataFrame:
    from mdr_dask import store
    from mdr_dask.fits.curve_tables import read_table
    from mdr_dask.fits.master_curve import friction_of_roughness
    from mdr_dask.questions import selection
    from mdr_dask.tables import is_table

    path = Path("/dev/stdin" if source == "-" else source)
    if is_table(path) or path.is_fifo() or source == "-":
        if series is not None:
            raise click.UsageError(f"a table has no series, got --series {series}")
        return _rows(read_table(path), selections)
    if "://" not in source and not path.exists():
        raise DataError(f"{source}: no such table or store")
    groups = store.datasets(source)
    if series is None and len(groups) > 1:
        return selection.select(friction_of_roughness(groups), selections, tell)
    return selection.select(selection.group(groups, series), selections, tell)


def _rows(frame: pd.DataFrame, selections: tuple[str, ...]) -> pd.DataFrame:
    import numpy as np
    import xarray as xr

    from mdr_dask.questions import selection

    units = frame.attrs.get("units", {})
    columns = {name: (name, np.unique(frame[name]), {"units": units.get(name, "1")}) for name in frame.columns}
    kept = selection.select(xr.Dataset(coords=columns), selections, tell)
    within = [frame[name].isin(kept[name].to_numpy()) for name in frame.columns]
    return frame[np.logical_and.reduce(within)]


def _print_table(curve: xr.Dataset, part: str, form: str) -> None:
    from mdr_dask.fits.collapse import sign_of
    from mdr_dask.fits.curve_tables import is_temperature

    if part == "factors":
        kept = ("shift_factor", "vertical_factor") if curve["vertical_factor"].any() else ("shift_factor",)
        shown = curve[[f"{name}{column}" for name in kept for column in ("", "_error", "_low", "_high")]]
        by = str(curve.attrs["group"])
        if form == "csv" and is_temperature(by, curve[by].attrs.get("units", "")):  # `shift_factors` reads this column
            shown = shown.assign({"log10 a_T": sign_of(str(curve.attrs["abscissa"])) * curve["shift_factor"]})
    else:
        dims = (part.removesuffix("s"),)
        shown = curve[[name for name in curve.data_vars if curve[name].dims == dims]]
    attrs = ("abscissa", "ordinate", "companion", "group")
    own = {f"{part.removesuffix('s')}_{key}": str(curve.attrs[key]) for key in attrs if curve.attrs.get(key)}
    rows, units = table(shown.rename({old: new for old, new in own.items() if old in shown}))
    print_rows(rows, units, form)


def _print(curve: xr.Dataset, part: str, form: str | None) -> None:
    if form == "json":
        print_json(curve.to_dict())
        return
    by = str(curve.attrs["group"])
    _print_table(curve, part, form or "table")
    moved = " and ".join(str(curve.attrs[name]) for name in ("ordinate", "companion") if curve.attrs.get(name))
    click.echo(f"shifted: {moved}; {curve.attrs['vertical']}", err=True)
    low, high = (float(curve["curve_abscissa"].attrs[f"measured_{end}"]) for end in ("low", "high"))
    ends = curve["curve_abscissa"].to_numpy()
    over = titled(str(curve.attrs["abscissa"]), curve["curve_abscissa"].attrs["units"])
    click.echo(
        f"{over} of the merged curve: {ends.min():.4g} .. {ends.max():.4g}, of which {low:.4g} .. {high:.4g} was "
        f"measured at {titled(by, curve[by].attrs['units'])} = {curve.attrs['reference']:.6g}",
        err=True,
    )
    constants = {str(n): float(v) for n, v in curve.data_vars.items() if v.ndim == 0 and f"{n}_low" in curve}
    for name, value in constants.items():
        interval = f"[{float(curve[f'{name}_low']):.5g}, {float(curve[f'{name}_high']):.5g}]"
        click.echo(f"{name} = {value:.5g} {curve[name].attrs['units']}, 95 %: {interval}".replace(" 1,", ","), err=True)
    for law in ("power", "arrhenius", "wlf"):
        if f"{law}_residual" in curve:
            click.echo(
                f"the law {law} deviates from the factors by {float(curve[f'{law}_residual']):.2g} decades (rms)",
                err=True,
            )
    if "law_holds" in curve:
        click.echo("law_holds = " + curve["law_holds"].item().replace(": ", "\n", 1), err=True)
    for sentence in ("not_used", "left_out", "undetermined"):
        if curve.attrs.get(sentence):
            click.echo(curve.attrs[sentence], err=True)
