"""Benchmarks of superposition."""
