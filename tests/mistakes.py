"""Campaigns with one mistake of each kind, and the messages about it, from ``campaign/mistakes.txt``.

After the name of a mistake follow lines of a campaign, and after ``>`` its messages. Lines that begin with ``name:``,
``seed:``, ``#`` or ``run`` are a whole campaign. Other lines are added to `BASE`, or replace its normal force.
"""

from pathlib import Path

BASE = "name: bad\nmodel: rubbing\nparameters:\n  length: 20 mm\n"
FORCE = "  normal_force: 1 N\n"
_ENTRIES = (Path(__file__).parent / "campaign/mistakes.txt").read_text().split("=== ")[1:]
MISTAKES = {name: entry.splitlines() for name, _, entry in (each.partition("\n") for each in _ENTRIES)}


def campaign(name: str) -> str:
    """Return the text of a campaign with a mistake."""
    text = "".join(f"{line}\n" for line in MISTAKES[name] if not line.startswith("> "))
    if text.startswith(("name: ", "seed: ", "#", "run ")):
        return text
    return BASE + (text if text.startswith("  normal_force: ") else FORCE + text)


def messages(name: str) -> list[str]:
    """Return the expected messages."""
    return [line.removeprefix("> ") for line in MISTAKES[name] if line.startswith("> ")]
