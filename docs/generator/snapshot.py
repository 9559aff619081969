"""Copies the report in words and its figures to docs/snapshot, which this repository holds: make snapshot.

What the studies write into results/ is not tracked, so that a run of them leaves a checkout as it was. The snapshot is
taken when its messages change; a figure that the report no longer shows is removed from it.
"""

import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SHOWN = re.compile(r"\]\(figures/([^)]+)\)")


def take(results: Path, snapshot: Path) -> list[str]:
    """Copy; returns the names of the figures. SystemExit if there is no report, or a figure of it is missing."""
    try:
        text = (results / "report.md").read_text(encoding="utf-8")
    except OSError:
        sys.exit(f"snapshot: there is no {results / 'report.md'}; run make studies first")
    names = sorted(set(SHOWN.findall(text)))
    if missing := [name for name in names if not (results / "figures" / name).is_file()]:
        sys.exit(f"snapshot: figures of the report are missing: {', '.join(missing)}")
    shutil.rmtree(snapshot / "figures", ignore_errors=True)
    (snapshot / "figures").mkdir(parents=True)
    for name in names:
        shutil.copyfile(results / "figures" / name, snapshot / "figures" / name)
    (snapshot / "report.md").write_text(text, encoding="utf-8")
    return names


if __name__ == "__main__":
    print(f"snapshot: {len(take(ROOT / 'results', ROOT / 'docs' / 'snapshot'))} figures in docs/snapshot")  # noqa: T201
