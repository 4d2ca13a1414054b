"""Make docs/thesis.md: ``python -m benchmarks thesis page [LINES]`` (60 rough lines if not given)."""

import sys
from pathlib import Path

from benchmarks.thesis import CHAPTERS, Studies, page

PAGE = Path(__file__).parents[2] / "docs" / "thesis.md"
HEAD = """\
# The thesis, claim by claim

Q. Li's dissertation stands behind every model here. Each row below is one claim, law, figure or table of it: what
it says, what is found here, and whether it holds. Figures with an interval (95 %) are from {lines} rough lines, unless
the campaign has fewer. Made by `python -m benchmarks thesis page {lines}`; a test makes every figure again on a reduced
study and fails if a verdict changes. Figures of version 0.1, and of independent studies, say so and are not made again.

Verdicts: **holds**; **holds within** the miss given; **does not hold**; **no data**: the thesis shows measurements that
are not public; **not modelled**.

"""


def main(lines: int = 60) -> None:
    PAGE.write_text(HEAD.format(lines=lines) + page(CHAPTERS, Studies(lines)))
    print(PAGE)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
