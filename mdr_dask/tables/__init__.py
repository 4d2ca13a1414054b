"""Read tables in the forms in which people and instruments write them.

A table is read in four stages, each in a module of its own:

1. `text`: the bytes of a file become text.
2. `cells`: the text becomes a grid of cells, some of which are numbers.
3. `sheet`: the head and the rows of numbers are found in the grid. The result is a `Sheet` with names, units and cells.
4. `columns`: `mdr_dask.headings` compares the names with the columns that a caller expects, and the numbers of these
   columns are converted to SI.

`numerals` contains the forms of numbers, with their decimal marks and marks between thousands.
"""

from mdr_dask.tables.cells import Line, further
from mdr_dask.tables.columns import AGREE, Read, described, listed, matched, numbers, read_columns, read_table
from mdr_dask.tables.sheet import Sheet, read_head, read_sheet
from mdr_dask.tables.text import SHEET, decoded, is_table
