"""Benchmarks of mixed."""
