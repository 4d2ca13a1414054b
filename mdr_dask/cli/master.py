"""The command master-curve: a store, a table or a kept curve to shift factors, a merged curve and a figure."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from mdr_dask.cli import selection
from mdr_dask.cli.printing import print_json, print_rows, table
from mdr_dask.cli.results import Reading, csv_option, json_option, select_option, series_option
from mdr_dask.cli.writing import figure_file, writing

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@click.command("master-curve", cls=Reading)
@click.argument("source")
@series_option
@select_option
@click.option("--over", help="What curves are drawn over: a column such as normal_force or time.")
@click.option("--of", "ordinate", help="Their values: a column such as friction_coefficient or modulus.")
@click.option("--by", help="What curves differ in: a column such as velocity or temperature.")
@click.option("--vertical", is_flag=True, help="Let curves shift along the ordinate too.")
@click.option("--reference", type=float, help="Group whose factors are zero, in the units of the source.")
@click.option(
    "--bootstrap",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Bootstrap samples of the factors to keep.",
)
@click.option("--keep", type=click.Path(path_type=Path), help="Keep the whole result in FILE.json, as a later SOURCE.")
@click.option("--plot", "figure", type=click.Path(path_type=Path), help="Draw curves, merged curve and factors.")
@json_option
@csv_option
def master_curve(
    source: str,
    series: str | None,
    selections: tuple[str, ...],
    over: str | None,
    ordinate: str | None,
    by: str | None,
    vertical: bool,
    reference: float | None,
    bootstrap: int,
    keep: Path | None,
    figure: Path | None,
    form: str | None,
) -> None:
    """Shift the curves of a store or a table into one master curve; print factors, errors and the laws they follow.

    SOURCE is a store, a table (CSV with a row of names, perhaps one of units; - for standard input) or a result kept by
    --keep, which is then only re-referenced. A source that varies in velocity and in temperature gives a shift of each.

    \b
    mdr-dask master-curve results/force_master_curve.zarr --plot master.png
    mdr-dask master-curve relaxation.csv --by T --reference 20 --keep factors.json
    mdr-dask master-curve factors.json --reference 60
    """
    from mdr_dask.fit.master_curve import master_curve as superpose
    from mdr_dask.fit.master_curve import rereferenced

    if figure is not None:
        figure_file(figure)
    path = Path(source)
    if path.suffix == ".json" and path.is_file():
        curve = _read(path)
        curve = curve if reference is None else rereferenced(curve, reference)
    else:
        curve = superpose(_open(source, series, selections), over, ordinate, by, vertical, reference, bootstrap)
    if keep is not None:
        with writing(keep):
            keep.write_text(json.dumps(curve.to_dict()))
    if figure is not None:
        from mdr_dask.plots.master_curve import draw_master_curve

        with writing(figure):
            draw_master_curve(curve).savefig(figure, dpi=150)
    _print(curve, form)


def _open(source: str, series: str | None, selections: tuple[str, ...]) -> xr.Dataset | pd.DataFrame:
    from mdr_dask import store
    from mdr_dask.fit.master_curve import friction_of_roughness, read_table

    path = Path("/dev/stdin" if source == "-" else source)
    if path.is_file() or path.is_fifo() or source == "-":
        return read_table(path)
    groups = store.datasets(source)
    if series is None and len(groups) > 1:
        return selection.select(friction_of_roughness(groups), selections)
    return selection.select(selection.group(groups, series), selections)


def _read(path: Path) -> xr.Dataset:
    import xarray as xr

    from mdr_dask.errors import DataError

    try:
        curve = xr.Dataset.from_dict(json.loads(path.read_text()))
    except (ValueError, KeyError, TypeError):
        curve = xr.Dataset()
    if "shift_factor" not in curve or "group" not in curve.attrs:
        raise DataError(f"{path}: not a master curve kept by --keep")
    return curve


def _print(curve: xr.Dataset, form: str | None) -> None:
    if form == "json":
        print_json(curve.to_dict())
        return
    by = str(curve.attrs["group"])
    kept = ("shift_factor", "vertical_factor") if curve["vertical_factor"].any() else ("shift_factor",)
    factors = curve[[f"{name}{part}" for name in kept for part in ("", "_error", "_low", "_high")]]
    rows, units = table(factors)
    print_rows(rows, units, form or "table")
    if "second" in curve.attrs:
        rows, units = table(curve[[f"second_factor{part}" for part in ("", "_error", "_low", "_high")]])
        print_rows(rows, units, form or "table")
        click.echo(
            f"shift = {by} part + {curve.attrs['second']} part, zero at {curve.attrs['second_reference']:.6g}; "
            f"chi-squared of the sum {curve.attrs['chi_squared']:.3g} a degree of freedom, "
            f"probability {curve.attrs['probability']:.2g}",
            err=True,
        )
    low, high = (float(curve["curve_abscissa"].attrs[f"measured_{end}"]) for end in ("low", "high"))
    ends = curve["curve_abscissa"].to_numpy()
    click.echo(
        f"merged over {curve.attrs['abscissa']} {ends.min():.4g} .. {ends.max():.4g}, "
        f"measured at {by} = {curve.attrs['reference']:.6g}: {low:.4g} .. {high:.4g}",
        err=True,
    )
    constants = {str(n): float(v) for n, v in curve.data_vars.items() if v.ndim == 0 and f"{n}_low" in curve}
    for name, value in constants.items():
        interval = f"[{float(curve[f'{name}_low']):.5g}, {float(curve[f'{name}_high']):.5g}]"
        click.echo(f"{name} = {value:.5g} {curve[name].attrs['units']}, 95 %: {interval}".replace(" 1,", ","), err=True)
