"""The command reference, made by ``python -m mdr_dask.cli.reference > docs/commands.md``."""

from __future__ import annotations

import click

from mdr_dask.cli import cli


def commands_page() -> str:
    """Return the Markdown page of all commands with their options."""
    parts = [
        "# Commands",
        "",
        "Made by `python -m mdr_dask.cli.reference > docs/commands.md`; do not edit.",
        "",
        *_text(cli.help or ""),
    ]
    for name, command in sorted(cli.commands.items()):
        parts += ["", f"## mdr-dask {name}", "", *_text(command.help or "")]
        options = [option for option in command.params if isinstance(option, click.Option)]
        arguments = [argument for argument in command.params if isinstance(argument, click.Argument)]
        usage = [f"[{a.name}]" if not a.required else str(a.name).upper() for a in arguments]
        parts += ["", f"Usage: `mdr-dask {' '.join([name, *usage, '[options]'])}`", ""]
        parts += ["| option | meaning |", "|---|---|"] if options else []
        parts += [_row(option) for option in options]
    return "\n".join(parts) + "\n"


def _text(help_text: str) -> list[str]:
    """Turn a help text into Markdown. Paragraphs that click does not wrap become blocks of code."""
    lines: list[str] = []
    for paragraph in help_text.split("\n\n"):
        kept = paragraph.strip().startswith("\b")
        body = [line.strip() for line in paragraph.replace("\b", "").strip().splitlines()]
        lines += ["```", *body, "```", ""] if kept else [*body, ""]
    return lines[:-1]


def _row(option: click.Option) -> str:
    names = ", ".join(f"`{name}`" for name in option.opts)
    kind = "" if option.is_flag or option.flag_value is not None else f" {option.make_metavar(click.Context(cli))}"
    meaning = (option.help or "").replace("|", "\\|")
    return f"| {names}{kind} | {meaning} |"


if __name__ == "__main__":
    click.echo(commands_page(), nl=False)
