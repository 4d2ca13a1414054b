"""Benchmarks of runner."""
