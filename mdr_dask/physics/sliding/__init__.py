"""Steady sliding of a viscoelastic foundation over a line at a prescribed load.

Read the module `problem` first, which chooses the solver and refines the grid until the results have the requested
accuracy.
"""
