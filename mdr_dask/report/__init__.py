"""The report on a study (one HTML file that needs no network), and the zip of a study for publication.

Read the modules in this order. `figures` converts a figure to data for the page. `cases` computes the means of all
cases, for figures whose axes the reader of the page chooses. `subjects` contains method, papers and limits of each
model. `study` collects the content for one store, `page` writes the HTML, and `publishing` writes the zip.
"""

from mdr_dask.report.page import page
from mdr_dask.report.study import Study, read_study

__all__ = ["Study", "page", "read_study"]
