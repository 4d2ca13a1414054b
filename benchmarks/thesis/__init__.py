"""The thesis, claim by claim: our figure for each, and the verdict; ``python -m benchmarks.thesis [LINES]``."""

from benchmarks.thesis import chapter_2, chapter_3
from benchmarks.thesis.ledger import Claim, Studies, Verdict, page

CHAPTERS: tuple[tuple[str, tuple[Claim, ...]], ...] = (
    ("Chapters 1 and 2: the method, rough lines", chapter_2.CLAIMS),
    ("Chapter 3: the law of friction", chapter_3.CLAIMS),
)

__all__ = ["CHAPTERS", "Claim", "Studies", "Verdict", "page"]
