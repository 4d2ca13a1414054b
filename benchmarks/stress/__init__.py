"""The search for cases that break a solver, for as long as it is told to."""
