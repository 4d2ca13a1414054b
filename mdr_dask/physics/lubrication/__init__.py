"""Oil films between rollers, and boundary layers that asperities break through.

Read the modules `oil` and `film_formulas` first. `line_contact` solves for the film on finer and finer grids. For rough
rollers, `load_sharing` divides the load between film and asperities, `clusters` finds the intervals in which the
asperities of both rollers overlap, and `breakthrough` decides in which of these intervals the asperities break the
boundary layer.
"""
