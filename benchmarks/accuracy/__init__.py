"""Error against processor time of every solver, beside references that share no code with it, on one page."""
