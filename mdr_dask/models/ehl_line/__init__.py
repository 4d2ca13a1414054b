"""The lubricated line contact: film, pressure and traction over load, speed and material parameter.

`declaration` has parameters and outputs and is light to import; `solve` turns a block into arrays.
"""

from mdr_dask.models.ehl_line.declaration import MODEL, EhlLineParameters, groups

__all__ = ["MODEL", "EhlLineParameters", "groups"]
