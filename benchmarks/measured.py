"""When, where, with which versions and by which command a benchmark was taken, which the report shows beside it."""

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


def record(facts: Mapping[str, Any], command: str, versions: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The record in findings: a sentence, the command and the provenance; `versions`: those of other packages."""
    core = json.loads(facts["dependencies"])
    libraries = {name: core[name] for name in ("heyoka", "numba", "numpy", "scipy")} | dict(versions or {})
    sentence = (
        f"Measured on {facts['measured']} with symtop {facts['symtop_version']}, revision {facts['symtop_revision']}, "
        f"on {facts['processor']} ({facts['cores']} cores, load {float(facts['load_before']):.2f} before), "
        f"{facts['platform']}, Python {facts['python_version']}; "
        f"{', '.join(f'{name} {version}' for name, version in sorted(libraries.items()))}. "
        f"The studies do not measure it again; `{command}` does."
    )
    return {
        "measured": sentence, "command": command, "provenance": {key: facts[key] for key in netcdf.provenance()},
    }  # fmt: skip
