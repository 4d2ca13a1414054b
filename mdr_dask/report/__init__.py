"""A page about a study: one HTML file that needs no network; and a study packed for publication.

Read in this order: `figures` (a figure as data for the page), `cases` (means of all cases, for the choice of axes),
`subjects` (method, papers and limits of each model), `study` (everything about one store), `page` (the HTML),
`publishing`.
"""

from mdr_dask.report.page import page
from mdr_dask.report.study import Study, read_study

__all__ = ["Study", "page", "read_study"]
