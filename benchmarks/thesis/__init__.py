"""The thesis, claim by claim: our figure for each, and the verdict; ``python -m benchmarks thesis page [LINES]``."""

from benchmarks.thesis import chapter_2, chapter_3, chapter_4, chapter_5, chapter_6
from benchmarks.thesis.ledger import Claim, Studies, Verdict, page

CHAPTERS: tuple[tuple[str, tuple[Claim, ...]], ...] = (
    ("Chapters 1 and 2: the method, rough lines", chapter_2.CLAIMS),
    ("Chapter 3: the law of friction", chapter_3.CLAIMS),
    ("Chapter 4: kinetics", chapter_4.CLAIMS),
    ("Chapter 5, appendices A and B: lubrication", chapter_5.CLAIMS),
    ("Chapters 6 and 7: wear, and what was left to do", chapter_6.CLAIMS),
)

__all__ = ["CHAPTERS", "Claim", "Studies", "Verdict", "page"]
