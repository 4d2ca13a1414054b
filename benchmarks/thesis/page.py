"""Write docs/thesis.md: ``python -m benchmarks thesis [LINES]`` (default: 60 rough lines)."""

from pathlib import Path

from benchmarks.thesis import CHAPTERS, Studies, page
from benchmarks.thesis.equations import table

PAGE = Path(__file__).parents[2] / "docs" / "thesis.md"
HEAD = """\
# The thesis, claim by claim

The models follow Q. Li's dissertation. Each row is one claim, law, figure or table of it, and the answer to *does it
hold?* Where a claim is a law that can be fitted, the answer is the sentence of the fit, of the worst case if there are
several. The other answers use the same scale: **yes** up to a departure of 5 % rms and 10 % in any case,
**approximately** up to 15 % and 30 %, **no** beyond, **not tested** ([friction](friction.md#laws)). **No data** means
that the thesis shows measurements that are not public, **not modelled** that there is no such model.

Numbers in brackets are 95 % intervals from {lines} rough lines, or as many as the campaign has. The page is made by
`python -m benchmarks thesis {lines}`. A test repeats every row on a reduced study and fails if an answer is
contradicted. Figures of version 0.1 and of independent studies are marked and are not repeated.

"""


def main(lines: str = "60") -> None:
    """Write the page."""
    PAGE.write_text(HEAD.format(lines=lines) + page(CHAPTERS, Studies(int(lines))) + "\n" + table())
    print(PAGE)
