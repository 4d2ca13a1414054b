"""Questions about a study: select a part, apply a condition, convert units, and return a table or labelled arrays.

Read the module `selection` (parts of a study) first, then the module `units` (columns in the requested units).
"""
