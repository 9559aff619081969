"""Charts to point at, as data for the page: each series with the look its integrator has in every figure."""

import json
import math
from collections.abc import Mapping
from typing import Any

from symtop.methods.registry import integrators
from symtop.report.style import look


def prepared(chart: Mapping[str, Any]) -> str:
    """JSON of a chart of the findings, safe inside a script element, without points that a log axis cannot show."""
    known = integrators()
    panels: dict[str, list[dict[str, Any]]] = {}
    for panel, series in chart["panels"].items():
        panels[panel] = []
        for name, points in series:
            family = known[name].family if name in known else "other"
            panels[panel].append(
                {
                    "name": name,
                    "family": family,
                    "color": look(name).color,
                    "marker": look(name).marker,
                    "dashed": name in known and known[name].tier == "python",
                    "points": [[x, y, words] for x, y, words in points if _positive(x) and _positive(y)],
                }
            )
    content = {"title": chart["title"], "x": chart["x"], "y": chart["y"], "panels": panels}
    return json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


def _positive(value: float | None) -> bool:
    return value is not None and math.isfinite(value) and value > 0.0
