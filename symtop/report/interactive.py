"""Charts to point at, as data for the page: each series with the look its integrator has in every figure."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from symtop.methods.registry import integrators
from symtop.report.style import look


def prepared(chart: Mapping[str, Any]) -> str:
    """JSON of a chart of the findings, safe inside a script element, without points that a log axis cannot show."""
    panels = {title: [_series(name, points) for name, points in series] for title, series in chart["panels"].items()}
    content = {"title": chart["title"], "x": chart["x"], "y": chart["y"], "panels": panels}
    return json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


def _series(name: str, points: Sequence[tuple[float | None, float | None, str]]) -> dict[str, Any]:
    method, style = integrators().get(name), look(name)
    return {
        "name": name,
        "family": method.family if method else "other",
        "color": style.color,
        "marker": style.marker,
        "dashed": method is not None and method.implementation == "python",
        "points": [[x, y, words] for x, y, words in points if _positive(x) and _positive(y)],
    }


def _positive(value: float | None) -> bool:
    return value is not None and math.isfinite(value) and value > 0.0
