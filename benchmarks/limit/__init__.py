"""Benchmarks of kernels against the roofs of the processor they run on."""
