"""Benchmarks of kinetics."""
