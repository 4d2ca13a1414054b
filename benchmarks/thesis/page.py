"""Test the claims in docs/thesis.md again: ``python -m benchmarks thesis [LINES]`` (default: 60 rough lines)."""

import re
from pathlib import Path

from benchmarks.thesis.claims import JUDGES
from benchmarks.thesis.ledger import Studies, word

PAGE = Path(__file__).parents[2] / "docs" / "thesis.md"


def cells(line: str) -> list[str]:
    """Return the cells of a row of a Markdown table: item, claim, verdict, explanation, command."""
    return re.split(r"(?<!\\) \| ", line[2:-2])


def main(lines: str = "60") -> None:
    """Write the verdicts of all claims in `JUDGES` into the page."""
    studies = Studies(int(lines))
    page = re.sub(r"(intervals from|benchmarks thesis) \d+", rf"\1 {lines}", PAGE.read_text()).splitlines()
    for number, line in enumerate(page):
        row = cells(line)
        if len(row) == 5 and row[1] in JUDGES:
            verdict = JUDGES[row[1]](studies)
            head = word(verdict)
            row[2] = f"**{head}**{verdict[len(head) :]}".replace("|", r"\|")
            page[number] = f"| {' | '.join(row)} |"
    PAGE.write_text("\n".join(page) + "\n")
