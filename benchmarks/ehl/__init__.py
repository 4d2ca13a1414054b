"""Benchmarks of ehl."""
