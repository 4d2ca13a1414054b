"""Benchmarks of measured surfaces, and of the validity of rough lines in place of surfaces."""
