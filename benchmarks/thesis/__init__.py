"""Test the thesis claim by claim: ``python -m benchmarks thesis [LINES]``."""
