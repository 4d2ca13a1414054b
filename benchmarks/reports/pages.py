"""The pages of quickstart and of one study of each model: `python -m benchmarks reports pages [FOLDER] [CAMPAIGN...]`.

Studies are run, or found done, beside the pages. Each line says the size of a page and the processor time of making it.
"""

import sys
import time
from pathlib import Path

from mdr_dask.cli import main
from mdr_dask.report import page, read_study

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
#: A study of each model, the quickest that shows it.
STUDIES = ("quickstart", "velocity_protocols", "stribeck", "ehl_map", "fretting2014")


def pages(folder, studies):
    """Run studies and write their pages; yield name, bytes and seconds of processor time of each."""
    for name in studies:
        place = folder / f"{name}.zarr"
        code = main(["run", str(CAMPAIGNS / f"{name}.yaml"), "--store", str(place), "--quiet"])
        if code > 1:
            sys.exit(code)
        started = time.process_time()
        text = page([read_study(str(place))])
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
        yield name, len(text.encode()), time.process_time() - started


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "reports")
    target.mkdir(parents=True, exist_ok=True)
    for name, size, seconds in pages(target, sys.argv[2:] or STUDIES):
        print(f"{target / name}.html: {size / 1e6:.1f} MB, {seconds:.0f} s of processor time")
