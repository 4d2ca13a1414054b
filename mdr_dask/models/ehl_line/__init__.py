"""The lubricated line contact: film thickness, pressure and traction for a given load, speed and oil."""

from mdr_dask.models.ehl_line.declaration import MODEL, EhlLineParameters, groups
