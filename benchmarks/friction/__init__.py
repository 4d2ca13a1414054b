"""Benchmarks of friction."""
