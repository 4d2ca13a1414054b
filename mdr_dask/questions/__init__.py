"""What a user asks of a study: which part of it, under which condition, in which units, as which table.

Read `selection` (parts of a study), then `units` (columns in the units asked for).
"""
