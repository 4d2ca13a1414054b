"""The lubricated line contact: film thickness, pressure and traction for a given load, speed and oil.

`declaration` defines the parameters and outputs, and is quick to import; `solve` computes the outputs of a block of
cases.
"""

from mdr_dask.models.ehl_line.declaration import MODEL, EhlLineParameters, groups

__all__ = ["MODEL", "EhlLineParameters", "groups"]
