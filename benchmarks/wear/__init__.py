"""Benchmarks of wear."""
