"""Figures: of a store by name, of any output of any store, and of campaigns that are run first."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.campaigns import CAMPAIGN
from mdr_dask.cli.options import select_option, tell, units_option, where_option
from mdr_dask.cli.results import list_names, require_known
from mdr_dask.cli.running import run
from mdr_dask.cli.writing import FIGURES, format_option, require_suffix, writing

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from mdr_dask.plots.base import Plot
    from mdr_dask.plots.page import Page

#: Options of figures of outputs; those with a name have axes of their own.
OF_OUTPUTS = ("over", "by", "panels", "effects", "log")
COMMAND = "mdr_dask.command"


class Drawing(click.Command):
    """A command that draws, and says in every table how it was called."""

    def parse_args(self, context: click.Context, arguments: list[str]) -> list[str]:
        """Keep the arguments as they were typed."""
        context.meta[COMMAND] = shlex.join(["mdr-dask", str(self.name), *arguments])
        return super().parse_args(context, arguments)


@click.command(cls=Drawing)
@click.argument("words", nargs=-1, required=True, metavar="STORE... [NAME...]")
@click.option("--all", "everything", is_flag=True, help="Draw every named figure that the store has the data for.")
@click.option("--over", multiple=True, metavar="AXIS", help="Draw an output against this axis; twice for a map.")
@click.option("--by", default="", metavar="AXIS", help="Axis, or sampled parameter, that gets the colours.")
@click.option("--panels", default="", metavar="AXIS", help="A panel for each value of this axis.")
@click.option("--effects", is_flag=True, help="Draw the mean of an output against every parameter that varies.")
@click.option("--series", multiple=True, help="Only this series; repeat.")
@select_option
@where_option
@click.option("--log", metavar="[x][y][z]", help="Logarithmic axes, z for colours; 'none' for none. Else by the data.")
@units_option
@click.option("--size", metavar="WIDTH[xHEIGHT]", help="Printed size: 85mm, 85x60mm.")
@click.option("--style", metavar="FILE", help="Style file of matplotlib, or the name of one of its styles.")
@click.option("--output", "-o", type=click.Path(path_type=Path), help="A file for one figure, else a folder.")
@format_option
@click.pass_context
def plot(
    context: click.Context,
    /,
    words: tuple[str, ...],
    everything: bool,
    series: tuple[str, ...],
    selections: tuple[str, ...],
    where: str,
    output: Path | None,
    suffix: str,
    **look: Any,
) -> None:
    """Draw figures by name, or any output against any axis; without a name, say which figures there are.

    Beside every figure stands its data, FIGURE.csv. A figure holds axes that it cannot show at one value, and says
    which; --select chooses another. Several stores share a figure.

    \b
    mdr-dask plot results/quickstart.zarr velocity -o quickstart.png
    mdr-dask plot results/friction_force.zarr --all -o figures
    mdr-dask plot results/friction_force.zarr regions --select 'normal_force=1 N'
    mdr-dask plot results/quickstart.zarr friction_coefficient --over velocity --by normal_force --size 85mm -o f.pdf
    mdr-dask plot results/quickstart.zarr friction_coefficient --over velocity --over normal_force -o map.png
    """
    from mdr_dask.plots import page, table
    from mdr_dask.questions import selection

    urls, names = _apart(words)
    known = _known_to_all(urls)
    if not names and not everything:
        list_names(_model(urls[0]), {name: figure.summary for name, figure in known.items()})
        return
    figures = _asked(names, everything, known, urls, look)
    places = _places(output, list(figures), urls, suffix, alone=len(names) == 1 and not everything)
    asked, style_file = _page(look), look.get("style")
    with page.drawing_for(asked, style_file), _readable(urls):
        groups = {key: data for url in urls for key, data in _groups(url, urls, series).items()}
        _require_quantities(asked.units, groups)
        groups = selection.select_all(groups, selections, tell)
        if where:
            groups = selection.where_all(groups, where)
            figures = {name: _without(figure, where) for name, figure in figures.items()}
        for (name, figure), path in zip(figures.items(), places, strict=True):
            origin = table.provenance(name, urls, str(context.meta.get(COMMAND, "")))
            _draw(figure, groups, path, origin, everything)
    if unused := asked.units.keys() - asked.used:
        tell(f"--units {', '.join(sorted(unused))}: shown in no figure that was drawn")


def _require_quantities(units: Mapping[str, str], groups: Mapping[str, xr.Dataset]) -> None:
    """Refuse units of what is no parameter and no output."""
    from mdr_dask.errors import DataError, did_you_mean

    known = sorted({str(name) for data in groups.values() for name in data.variables})
    for name in units:
        if name not in known:
            raise DataError(f"no quantity {name!r} to give a unit{did_you_mean(name, known)}")


def _without(figure: Plot, where: str) -> Plot:
    """Return a figure that says which cases it leaves out."""
    from mdr_dask.plots import style

    def draw(groups: Mapping[str, xr.Dataset]) -> Figure:
        drawn = figure.draw(groups)
        style.leave_out(drawn, [f"cases other than {where}"])
        return drawn

    return replace(figure, draw=draw)


def _apart(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the stores among the words of a command, and the names behind them."""
    from mdr_dask.store import is_study

    def is_place(word: str) -> bool:
        return "/" in word or word.endswith(".zarr") or is_study(word)

    count = next((k for k, word in enumerate(words) if k and not is_place(word)), len(words))
    return list(words[:count]), list(words[count:])


def _known_to_all(urls: Sequence[str]) -> dict[str, Plot]:
    """Return the figures by name that all stores have."""
    from mdr_dask import plots

    each = [plots.available(_model(url)) for url in urls]
    return {name: figure for name, figure in each[0].items() if all(name in other for other in each)}


def _model(url: str) -> str:
    from mdr_dask.store import attributes

    return str(attributes(url)["model"])


def _in(urls: Sequence[str]) -> list[str]:
    """Return the outputs of stores."""
    from mdr_dask import store as stores

    found = [name for url in urls for data in stores.datasets(url).values() for name in map(str, data.data_vars)]
    return [name for name in dict.fromkeys(found) if name != "status"]


def _asked(
    names: Sequence[str], everything: bool, known: Mapping[str, Plot], urls: Sequence[str], look: Mapping[str, Any]
) -> dict[str, Plot]:
    """Return the figures that are asked for, by the name of their files."""
    outputs, model = _in(urls), _model(urls[0])
    given = [option for option in OF_OUTPUTS if look.get(option)]
    if not (look.get("over") or look.get("effects")):
        for name in names:
            if name in outputs and name not in known:
                raise click.UsageError(f"{name} is an output: say --over AXIS, or --effects")
        require_known(names, list(known), f"figure of {model}")
        if given:
            raise click.UsageError(
                f"--{given[0]} is for an output with --over or --effects: a named figure has its own"
            )
        return dict(known) if everything else {name: known[name] for name in names}
    if everything:
        raise click.UsageError("expected --all, or outputs with --over or --effects, got both")
    require_known(names, outputs, "output in this study")
    for name in names:
        if name in known:
            tell(f"{name}: the output; without --over it is a figure, too")
    return {f"{name}{ending}": _of_output(name, look) for name in names for ending in [_ending(look)]}


def _of_output(name: str, look: Mapping[str, Any]) -> Plot:
    from mdr_dask.plots.outputs import View, of_output

    over = tuple(axis.replace(".", "_") for axis in look["over"])
    if len(over) > 2 or (over and look["effects"]):
        raise click.UsageError("expected --over once, twice for a map, or --effects")
    log = look["log"]
    if log is not None and log != "none" and not set(log) <= set("xyz"):
        raise click.UsageError(f"expected --log with letters of xyz, or 'none', got {log!r}")
    by, panels = (look[key].replace(".", "_") for key in ("by", "panels"))
    return of_output(View(name, over, by, panels, "" if log == "none" else log))


def _ending(look: Mapping[str, Any]) -> str:
    return f"-over-{'-'.join(look['over'])}" if look["over"] else "-effects"


def _page(look: Mapping[str, Any]) -> Page:
    from mdr_dask.plots import page

    width, height = page.size(look["size"]) if look.get("size") else (None, None)
    return page.Page(width, height, look.get("units") or {})


def _readable(urls: Sequence[str]) -> Any:
    from mdr_dask.store import readable

    return readable(", ".join(urls))


def _groups(url: str, urls: Sequence[str], series: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the groups of a store, by names that tell the stores apart."""
    from mdr_dask import store as stores
    from mdr_dask.questions import selection

    groups = stores.datasets(url)
    groups = {name: selection.group(groups, name) for name in series} if series else groups
    return {_called(url, urls, name): data for name, data in groups.items()}


def _called(url: str, urls: Sequence[str], series: str) -> str:
    """Return how a legend names a group: by its series, and by its store where there are several."""
    if len(urls) == 1:
        return series
    stems = [Path(each).stem for each in urls]
    store = Path(url).stem if stems.count(Path(url).stem) == 1 else url
    return f"{store} {series}".strip()


def _draw(figure: Plot, groups: Mapping[str, xr.Dataset], path: Path, origin: dict[str, str], one_of: bool) -> None:
    """Draw a figure into a file, its data beside it; one of all that cannot be drawn is named."""
    from mdr_dask.errors import DataError, FitError
    from mdr_dask.plots import style

    try:
        drawn = figure.figure(groups)
    except (DataError, FitError) as error:
        if not one_of:
            raise
        click.echo(f"{figure.name}: left out: {error}", err=True)
        return
    save(drawn, path, origin)
    click.echo(str(path))
    if style.left_out(drawn):
        click.echo(f"{figure.name}: not drawn: {style.left_out(drawn)}", err=True)


def save(figure: Figure, path: Path, origin: Mapping[str, str]) -> None:
    """Write a figure, and its data beside it; a table there that is of no figure is not written over."""
    from mdr_dask.plots import table

    if not isinstance(figure, table.Drawn):
        with writing(path):
            table.save_picture(figure, path)
        return
    figure.origin = origin
    with writing(table.table_beside(path)), writing(path):
        figure.save(path)


def _places(output: Path | None, names: Sequence[str], urls: Sequence[str], suffix: str, alone: bool) -> list[Path]:
    """Return the file of each figure: the one that is named for a figure alone, or in a folder."""
    folder = output or Path("figures")
    if alone and folder.suffix and not folder.is_dir():
        require_suffix(folder, FIGURES)
        return [folder]
    if folder.suffix in FIGURES and not folder.is_dir():
        raise click.UsageError(f"expected a folder for the figures, got {str(folder)!r}")
    stem = "-".join(Path(url).stem for url in urls)
    return [folder / f"{stem}-{name}.{suffix}" for name in names]


@click.command(cls=Drawing)
@click.argument("campaigns", nargs=-1, required=True, type=CAMPAIGN)
@click.option("--output", "-o", default="figures", show_default=True, help="Folder of the figures.")
@format_option
@click.option("--quiet", is_flag=True, help="No progress on stderr.")
@click.pass_context
def figures(context: click.Context, /, campaigns: tuple[Path, ...], output: str, suffix: str, quiet: bool) -> int:
    """Run campaigns, or what is missing of them, and draw every figure that their stores hold data for.

    \b
    mdr-dask figures campaigns/friction_force.yaml campaigns/friction_hurst.yaml -o figures
    """
    from mdr_dask.campaign import load

    codes: list[int] = []
    for path in campaigns:
        codes.append(context.invoke(run, campaign=path, quiet=quiet))
        context.invoke(plot, words=(load(path).store,), everything=True, output=Path(output), suffix=suffix)
    return max(codes)
