"""The command that draws figures of a store: named figures, and any output against its parameters."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.cli.options import select_option, tell, units_option, where_option
from mdr_dask.cli.results import list_names, require_known
from mdr_dask.cli.writing import FIGURES, format_option, require_suffix, writing

if TYPE_CHECKING:
    import xarray as xr

    from mdr_dask.plots.base import Plot
    from mdr_dask.plots.figure import Figure

#: Options that apply only to figures of outputs, because the axes of a named figure are fixed.
OF_OUTPUTS = ("over", "by", "panels", "effects", "log")
COMMAND = "mdr_dask.command"


class Drawing(click.Command):
    """A command that draws figures. It writes the data of each figure, with the command line, to a table next to it."""

    def parse_args(self, context: click.Context, arguments: list[str]) -> list[str]:
        """Store the command line as it was typed, then parse it."""
        context.meta[COMMAND] = shlex.join(["mdr-dask", str(self.name), *arguments])
        return super().parse_args(context, arguments)


@click.command(cls=Drawing)
@click.argument("words", nargs=-1, required=True, metavar="STORE... [NAME...]")
@click.option("--all", "everything", is_flag=True, help="Draw every named figure for which the store has the data.")
@click.option("--over", multiple=True, metavar="AXIS", help="Draw an output against this axis; twice for a map.")
@click.option("--by", default="", metavar="AXIS", help="Axis or sampled parameter that the colours show.")
@click.option("--panels", default="", metavar="AXIS", help="One panel for each value of this axis.")
@click.option("--effects", is_flag=True, help="Draw the mean of an output against each varied parameter.")
@click.option("--series", multiple=True, help="Draw only this series; may be repeated.")
@select_option
@where_option
@click.option(
    "--log", metavar="[x][y][z]", help="Logarithmic axes: letters of xyz (z: colours), or none.  [chosen by the data]"
)
@units_option
@click.option("--measured", metavar="FILE", help="Also draw the measured points of this table, with error bars.")
@click.option("--title", metavar="TEXT", help="Title; '' for none.  [a description, but none with --size]")
@click.option("--size", metavar="WIDTH[xHEIGHT]", help="Size on paper: 85mm, 85x60mm.")
@click.option("--style", metavar="FILE", help="Style file of matplotlib, or the name of one of its styles.")
@click.option(
    "--output", "-o", type=click.Path(path_type=Path), help="File of a single figure, or folder of several figures."
)
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
    measured: str | None,
    output: Path | None,
    suffix: str,
    **look: Any,
) -> None:
    """Draw figures by name, or any output against any axis; without a name, list the figures.

    The data of every figure are written to a table next to it, FIGURE.csv. If a study has more axes than a figure can
    show, each further axis is fixed at one value, which is printed. Choose another value with --select. Several stores
    can be drawn in one figure.

    \b
    mdr-dask plot results/quickstart.zarr velocity -o quickstart.png
    mdr-dask plot results/friction_force.zarr --all -o figures
    mdr-dask plot results/friction_force.zarr velocity --select 'normal_force=1 N'
    mdr-dask plot results/quickstart.zarr friction_coefficient --over velocity --by normal_force --size 85mm -o f.pdf
    mdr-dask plot results/quickstart.zarr friction_coefficient --over velocity --over normal_force -o map.png
    mdr-dask plot results/rubber.zarr velocity --measured rig.csv -o rig.pdf
    """
    from mdr_dask.plots import page
    from mdr_dask.plots.base import provenance
    from mdr_dask.questions import selection
    from mdr_dask.store import readable

    urls, names = _split(words)
    known = _known_to_all(urls)
    if not names and not everything:
        list_names(_model(urls[0]), {name: figure.summary for name, figure in known.items()})
        return
    figures = _requested(names, everything, known, urls, look)
    places = _places(output, list(figures), urls, suffix, alone=len(names) == 1 and not everything)
    width, height = page.size(look["size"]) if look["size"] else (None, None)
    asked = page.Page(width, height, look["title"], look["units"] or {})
    with page.drawing_for(asked, look["style"]), readable(", ".join(urls)):
        groups = {key: data for url in urls for key, data in _groups(url, urls, series).items()}
        _require_quantities(asked.units, groups)
        groups = selection.select_all(groups, selections, tell)
        if where:
            groups = selection.where_all(groups, where)
        warnings = _warnings(urls)
        figures = {name: _with_notes(figure, where, warnings) for name, figure in figures.items()}
        if measured is not None:
            from mdr_dask.plots.measured import with_points

            groups, figures = with_points(groups, figures, measured)
        for (name, figure), path in zip(figures.items(), places, strict=True):
            origin = provenance(name, urls, str(context.meta.get(COMMAND, "")))
            _draw(figure, groups, path, origin, everything)
    if unused := look["units"].keys() - asked.used:
        tell(f"--units {', '.join(sorted(unused))}: not shown in any figure that was drawn")


def _require_quantities(units: Mapping[str, str], groups: Mapping[str, xr.Dataset]) -> None:
    """Raise DataError if a unit is given for a name that is neither a parameter nor an output."""
    from mdr_dask.errors import DataError, did_you_mean

    known = sorted({str(name) for data in groups.values() for name in data.variables})
    for name in units:
        if name not in known:
            raise DataError(f"no quantity {name!r} to give a unit{did_you_mean(name, known)}")


def _with_notes(figure: Plot, where: str, warnings: list[str]) -> Plot:
    """Return a figure that names the condition of its cases, and shows the warnings of its results."""

    def draw(groups: Mapping[str, xr.Dataset]) -> Figure:
        drawn = replace(figure.draw(groups), warnings=warnings)
        drawn.leave_out([f"cases other than {where}"] * bool(where))
        return drawn

    return replace(figure, draw=draw)


def _warnings(urls: Sequence[str]) -> list[str]:
    """Return the warnings of finished results. Equal warnings appear once, with the number of results."""
    from mdr_dask import store as stores
    from mdr_dask.questions import progress

    found = []
    for url in urls:
        studies = stores.datasets(url)
        messages = [message for name, data in studies.items() for message in progress.messages(url, name, data)]
        done = [message for message in messages if message["status"] == "done"]
        found += [
            f"{group.results} result{'s' * (group.results > 1)} in the store: {group.reason}"
            for group in progress.grouped(done, studies)
        ]
    return found


def _split(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the stores among the arguments of a command, and the names that follow them."""
    from mdr_dask.store import is_study

    def is_place(word: str) -> bool:
        return "/" in word or word.endswith(".zarr") or is_study(word)

    count = next((k for k, word in enumerate(words) if k and not is_place(word)), len(words))
    return list(words[:count]), list(words[count:])


def _known_to_all(urls: Sequence[str]) -> dict[str, Plot]:
    """Return the named figures that exist for the models of all stores."""
    from mdr_dask import plots

    each = [plots.available(_model(url)) for url in urls]
    return {name: figure for name, figure in each[0].items() if all(name in other for other in each)}


def _model(url: str) -> str:
    from mdr_dask.store import attributes

    return str(attributes(url)["model"])


def _outputs_of(urls: Sequence[str]) -> list[str]:
    from mdr_dask import store as stores

    found = [name for url in urls for data in stores.datasets(url).values() for name in map(str, data.data_vars)]
    return [name for name in dict.fromkeys(found) if name != "status"]


def _requested(
    names: Sequence[str], everything: bool, known: Mapping[str, Plot], urls: Sequence[str], look: Mapping[str, Any]
) -> dict[str, Plot]:
    """Return the requested figures, by the names for their files."""
    from mdr_dask.errors import did_you_mean

    outputs, model = _outputs_of(urls), _model(urls[0])
    given = [option for option in OF_OUTPUTS if look.get(option)]
    if not (look["over"] or look["effects"]):
        for name in names:
            if name in outputs and name not in known:
                raise click.UsageError(f"{name} is an output: add --over AXIS, or --effects")
            if name not in known and "mean" in (hint := did_you_mean(name, [*known, *outputs])):
                raise click.UsageError(f"no figure and no output {name!r}{hint}")
        require_known(names, list(known), f"figure of {model}")
        if given:
            raise click.UsageError(
                f"--{given[0]} needs an output with --over or --effects; the axes of a named figure are fixed"
            )
        return dict(known) if everything else {name: known[name] for name in names}
    if everything:
        raise click.UsageError("expected --all, or outputs with --over or --effects, got both")
    require_known(names, outputs, "output in this study")
    ending = f"-over-{'-'.join(look['over'])}" if look["over"] else "-effects"
    return {f"{name}{ending}": _of_output(name, look) for name in names}


def _of_output(name: str, look: Mapping[str, Any]) -> Plot:
    from mdr_dask.plots.view import View, figure_of

    over = tuple(axis.replace(".", "_") for axis in look["over"])
    if len(over) > 2 or (over and look["effects"]):
        raise click.UsageError("expected --over once, --over twice (for a map), or --effects")
    log = look["log"]
    if log is not None and log != "none" and not set(log) <= set("xyz"):
        raise click.UsageError(f"expected --log with letters of xyz, or 'none', got {log!r}")
    by, panels = (look[key].replace(".", "_") for key in ("by", "panels"))
    return figure_of(View(name, over, by, panels, "" if log == "none" else log))


def _groups(url: str, urls: Sequence[str], series: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the groups of a store. If several stores are drawn, their names begin with the name of the store."""
    from mdr_dask import store as stores
    from mdr_dask.questions import selection

    groups = stores.datasets(url)
    groups = {name: selection.group(groups, name) for name in series} if series else groups
    return {_name_of(url, urls, name): data for name, data in groups.items()}


def _name_of(url: str, urls: Sequence[str], series: str) -> str:
    """Return the name of a group in a legend: its series, after the name of its store if there are several stores."""
    if len(urls) == 1:
        return series
    stems = [Path(each).stem for each in urls]
    store = Path(url).stem if stems.count(Path(url).stem) == 1 else url
    return f"{store} {series}".strip()


def _draw(figure: Plot, groups: Mapping[str, xr.Dataset], path: Path, origin: dict[str, str], one_of: bool) -> None:
    """Draw a figure to a file, with its data in a table next to it.

    If the figure cannot be drawn, raise an error, or only print it if this is one of several figures (`one_of`).
    """
    from mdr_dask.errors import DataError, FitError

    try:
        description = figure.describe(groups)
    except (DataError, FitError) as error:
        if not one_of:
            raise
        click.echo(f"{figure.name}: left out: {error}", err=True)
        return
    save(description, path, origin)
    click.echo(str(path))


def save(description: Figure, path: Path, origin: Mapping[str, str]) -> None:
    """Draw a figure, write its data to a table next to it, and print notes that the picture does not show."""
    from mdr_dask.plots import labels, page, render

    drawn = render.render(description)
    drawn.origin = origin
    with writing(render.table_beside(path)), writing(path):
        drawn.save(path)
    asked = page.current()
    if asked.title is not None or asked.width is not None:
        for text in (description.fixed, *(f"warning: {warning}" for warning in description.warnings)):
            if text:
                click.echo(f"{path.name}: {labels.plain(text)}", err=True)
    if description.left_out:
        click.echo(f"{path.name}: not drawn: {labels.plain('; '.join(description.left_out))}", err=True)


def _places(output: Path | None, names: Sequence[str], urls: Sequence[str], suffix: str, alone: bool) -> list[Path]:
    """Return the path of the file of each figure.

    A single figure may have any path; several figures are written to a folder.
    """
    folder = output or Path("figures")
    if alone and folder.suffix and not folder.is_dir():
        require_suffix(folder, FIGURES)
        return [folder]
    if folder.suffix in FIGURES and not folder.is_dir():
        raise click.UsageError(f"expected a folder for the figures, got {str(folder)!r}")
    stem = "-".join(Path(url).stem for url in urls)
    return [folder / f"{stem}-{name}.{suffix}" for name in names]
