"""Solvers beside those of other programs, and beside the ways of the papers: into docs/comparison.md.

Each file is a subject and can be run alone. A peer that is not installed is named with the line that installs it, and
the others run. Peers are dependencies of these benchmarks only: ``pip install '.[peers]'``.
"""
