"""Benchmarks of protocols."""
