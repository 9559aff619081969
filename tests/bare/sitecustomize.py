"""Hide dask, which is optional and which xarray imports if it is there: 0.4 s of each command that a test runs.

An installation without extras has none. What needs it in a process of its own sets `SYMTOP_TESTS_DASK`.
"""

import os
import sys

if "SYMTOP_TESTS_DASK" not in os.environ:
    sys.modules["dask"] = None
