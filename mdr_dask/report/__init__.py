"""A page for every study: one HTML file that needs no network, the same page served, and a study to be published.

Read in this order: `figures` (a drawn figure as data for the page), `cases` (means of all cases, to choose from),
`subjects` (methods, papers and limits of each model), `study` (all that the page says of one store), `page` (the HTML
with its content security policy), `serving`, `publishing`.
"""

from mdr_dask.report.page import page
from mdr_dask.report.study import Study, read_study

__all__ = ["Study", "page", "read_study"]
