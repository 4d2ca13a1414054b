"""The command line. Only this package prints results and ends the process."""

from __future__ import annotations

import io
import logging
import os
import signal
import sys
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from mdr_dask.cli.campaigns import check, init, models, schema
from mdr_dask.cli.figures import plot
from mdr_dask.cli.fitting import fit, sensitivity
from mdr_dask.cli.master import master_curve
from mdr_dask.cli.printing import printable, say
from mdr_dask.cli.results import law, show, status
from mdr_dask.cli.running import run
from mdr_dask.cli.storage import publish, report, verify
from mdr_dask.cli.surface import surface
from mdr_dask.version import __version__

BROKE = 3
INTERRUPTED = 130
#: Groups of commands in ``--help``, with one line for each command. All other commands are listed last.
GROUPS = {
    "study": {
        "check": "check campaign files, and estimate the cost",
        "run": "compute all results that are missing",
        "status": "show progress, failures and messages",
        "verify": "read every file of a store, and list faults",
    },
    "answers": {
        "show": "show results as a table",
        "fit": "fit laws, or calibrate unknown parameters",
        "master-curve": "shift curves into one master curve",
        "plot": "draw figures",
        "report": "write one page about a study",
    },
}


class Commands(click.Group):
    """A group whose help lists its commands by purpose."""

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Write each command of a group with one line of help, and then the names of all other commands."""
        for title, lines in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl(list(lines.items()))
        others = [name for name in sorted(self.commands) if not any(name in names for names in GROUPS.values())]
        with formatter.section("more"):
            formatter.write_text(f"{', '.join(others)}; each with --help")

    def invoke(self, context: click.Context) -> Any:
        """Run a command. Return 0 if a program such as ``head`` stops reading the output."""
        try:
            result = super().invoke(context)
            sys.stdout.flush()
        except BrokenPipeError:
            _discard_output()
            return 0
        return result


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="mdr-dask")
def cli() -> None:
    """Parameter studies for tribology with the method of dimensionality reduction.

    \b
    mdr-dask init sliding_friction -o mine.yaml    write a first campaign file to edit
    mdr-dask check mine.yaml                       check the file, and estimate the cost
    mdr-dask run mine.yaml                         compute all results that are missing
    mdr-dask show results/sliding_friction.zarr    print results as a table, also during a run
    mdr-dask plot results/sliding_friction.zarr    draw figures
    mdr-dask report results/sliding_friction.zarr  write one page about the study

    Exit codes: 0 success, 1 failed cases or a damaged store, 2 wrong input or a refused command, 3 a fault of the
    program, 130 interrupted. An environment variable can set an option: MDR_DASK_RUN_THREADS=4 means `run --threads 4`.
    """


for command in (
    models,
    init,
    check,
    run,
    status,
    verify,
    show,
    fit,
    sensitivity,
    law,
    plot,
    report,
    publish,
    master_curve,
    surface,
    schema,
):
    cli.add_command(command)
    for option in command.params:
        if isinstance(option, click.Option) and option.name != "form":
            words = f"{command.name}{max(option.opts, key=len).removeprefix('-')}"
            option.envvar = f"MDR_DASK_{words.upper().replace('-', '_')}"


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    from mdr_dask.errors import MdrDaskError

    _open_streams()
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        result = cli.main(arguments, prog_name="mdr-dask", standalone_mode=False)
    except click.ClickException as error:
        context = error.ctx if isinstance(error, click.UsageError) else None
        say(error.format_message().rstrip(".") + (f" (see {context.command_path} --help)" if context else ""), err=True)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        say("interrupted; finished results are kept; the same command computes the others", err=True)
        return INTERRUPTED
    except MdrDaskError as error:
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # hides messages about cancelled tasks of Zarr
        say(str(error), err=True)
        return 2
    except OSError as error:
        say(f"{error.filename or 'input or output'}: {error.strerror or error}", err=True)
        _discard_output()
        return 2
    except Exception:
        click.echo(printable(traceback.format_exc()), err=True)
        say(f"a fault of mdr_dask {__version__}; finished results are kept; please report the lines above", err=True)
        return BROKE
    return result if isinstance(result, int) else 0


def _open_streams() -> None:
    """Replace missing standard streams, and let streams write characters outside their encoding as ASCII escapes."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:  # the stream was closed by a service manager, or by `>&-` in a shell
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _discard_output() -> None:
    """Discard the rest of the output, so that Python exits without another error."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _interrupt(*_: object) -> None:
    """Raise KeyboardInterrupt on SIGTERM, which batch systems send when the time of a job is over."""
    raise KeyboardInterrupt
