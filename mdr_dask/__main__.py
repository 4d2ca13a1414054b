"""Run the command line as ``python -m mdr_dask``."""

import sys

from mdr_dask.cli import main

if __name__ == "__main__":
    sys.exit(main())
