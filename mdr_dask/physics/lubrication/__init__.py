"""Oil films between rollers, and the boundary layers that break through them; read `oil` and `film_formulas` first.

`line_contact` solves for the film on finer and finer grids. For rough rollers, `load_sharing` divides the load between
film and asperities, `clusters` finds overlapping asperities, and `breakthrough` decides which of them break the layer.
"""
