"""The report on a study (one HTML file that needs no network), and the zip of a study for publication."""

from mdr_dask.report.page import page
from mdr_dask.report.study import Study, read_study
