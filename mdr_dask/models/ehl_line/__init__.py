"""The lubricated line contact: film, pressure and traction as functions of load, speed and material parameter.

`declaration` holds parameters and outputs and is fast to import; `solve` computes the arrays of a block.
"""

from mdr_dask.models.ehl_line.declaration import MODEL, EhlLineParameters, groups

__all__ = ["MODEL", "EhlLineParameters", "groups"]
