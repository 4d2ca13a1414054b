"""Runs commands one by one in forks of a fresh process, and tells what each did: see test_counts.py.

Arguments: a JSON list of commands. Prints a JSON list with exit code, output, modules and files opened of each.
"""

import contextlib
import io
import json
import os
import sys
import tempfile

from mdr_dask.cli import main


def done(arguments):
    """Return what a command does in this process."""
    opened = []
    sys.addaudithook(lambda event, found: opened.append(str(found[0])) if event == "open" else None)
    told = io.StringIO()
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        code = main(arguments)
    return {"code": code, "told": told.getvalue(), "modules": sorted(sys.modules), "opened": opened}


def forked(arguments):
    """Return what a command does in a copy of this process."""
    with tempfile.TemporaryFile("w+") as report:
        child = os.fork()
        if child == 0:
            try:
                json.dump(done(arguments), report)
                report.flush()
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        report.seek(0)
        return json.load(report)


if __name__ == "__main__":
    print(json.dumps([forked(arguments) for arguments in json.loads(sys.argv[1])]))
