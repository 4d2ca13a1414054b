"""What a worker does with memory that it has used once."""

import subprocess
import sys

import pytest

FAULTS = """
import resource
import numpy as np
from mdr_dask.task import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(10):
        arrays = [np.ones(400_000) for _ in range(5)]
        del arrays
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

keep_freed_memory()
faults()
print(faults())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc")
def test_arrays_of_some_megabytes_do_not_fault_again():
    done = subprocess.run([sys.executable, "-P", "-c", FAULTS], capture_output=True, text=True, check=True)
    # five arrays of 3.2 MB are 3900 pages, ten times over
    assert int(done.stdout) < 4000
