"""When, where and with which versions a benchmark was taken, in a sentence that the report shows beside its numbers."""

import datetime
import json
import os
from collections.abc import Mapping
from typing import Any

from symtop.core import netcdf


def circumstances() -> dict[str, Any]:
    """Date, cores and load now, with symtop's provenance; call it before anything is timed."""
    return {
        "measured": datetime.datetime.now(tz=datetime.UTC).date().isoformat(),
        "cores": os.cpu_count() or 0,
        "load_before": os.getloadavg()[0],
        **netcdf.provenance(changes=True),
    }


def sentence(facts: Mapping[str, Any], command: str, versions: Mapping[str, str] | None = None) -> str:
    """The circumstances in words; `versions` are those of further packages."""
    core = json.loads(facts["dependencies"])
    given = {name: core[name] for name in ("heyoka", "numba", "numpy", "scipy")} | dict(versions or {})
    return (
        f"Measured on {facts['measured']} with symtop {facts['symtop_version']}, revision {facts['symtop_revision']}, "
        f"on {facts['processor']} ({facts['cores']} cores, load {float(facts['load_before']):.2f} before), "
        f"{facts['platform']}, Python {facts['python_version']}; "
        f"{', '.join(f'{name} {version}' for name, version in sorted(given.items()))}. "
        f"The studies do not measure it again; `{command}` does."
    )
