"""Test the thesis claim by claim: ``python -m benchmarks thesis [LINES]``."""

from benchmarks.thesis.claims import CHAPTERS
from benchmarks.thesis.ledger import WORDS, Claim, FromFit, Studies, page, word

__all__ = ["CHAPTERS", "WORDS", "Claim", "FromFit", "Studies", "page", "word"]
