"""The card of a judged step, one self-contained page, and the badge for a README.

The card has two figures, errors against the step size with their order, and the energy over the long run; below them
the claims table, with the reason of each verdict. The badge states the properties of the method, or the claims that are
refuted, as SVG with a fixed width per letter, so that it looks the same with any font.
"""

import io
import math
import textwrap
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from symtop.core import netcdf
from symtop.core.errors import SymtopError, file_path, shown
from symtop.judging.findings import Finding, Ledger, claim_name, description
from symtop.model.charts import BODY
from symtop.report.figures import SMALLEST
from symtop.report.style import BLUE, GREEN, GREY, ORANGE, PAPER, VERMILLION, slope_guide
from symtop.report.template import environment

LETTER_WIDTH = 6.6  # width of a letter of the badge, pixels
LONGEST_TEXT = 72  # letters of the text of a badge
SIGNS = {"confirmed": "✓", "refuted": "✗", "measured": "=", "undecided": "?", "inapplicable": "–"}


def figures(ledger: Ledger) -> tuple[Any, Any]:
    """Two figures: errors against the step size, and the change of the energy over the long run."""
    with mpl.rc_context(PAPER):  # without changing the caller's settings
        drawings = Figure(figsize=(4.8, 3.9)), Figure(figsize=(4.8, 3.9))
        _order(drawings[0].subplots(), ledger)
        _energy(drawings[1].subplots(), ledger)
    return drawings


def _as_svg(figure: Any) -> str:
    """A figure as SVG, from its opening tag on."""
    buffer = io.StringIO()
    with mpl.rc_context(PAPER):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue().partition("<svg")[2]


def _order(axis: Any, ledger: Ledger) -> None:
    traces, finding = ledger.traces, ledger["order"]
    axis.set(title=f"order: {finding.measured or 'not measured'}", xlabel="step size", ylabel="error at the end (rad)")
    steps, errors = (np.asarray(traces.get(name, [])) for name in ("step_size", "error"))
    valid = np.isfinite(steps) & (errors > 0.0)
    if not valid.any():
        _write_reason(axis, finding)
        return
    in_fit = np.asarray(traces["fitted"]) == 1.0
    axis.plot(steps[valid], errors[valid], "o", color=GREY, fillstyle="none", label="not in the fit")
    axis.plot(steps[valid & in_fit], errors[valid & in_fit], "o", color=BLUE, label="in the fit")
    axis.set(xscale="log", yscale="log")
    claimed = finding.declared.isdigit()
    slope = float(finding.declared) if claimed else finding.value
    if 0.5 < slope < 99.0:
        points = valid & in_fit if (valid & in_fit).any() else valid
        span, order = (steps[points].min(), steps[points].max()), round(slope)
        label = f"$h^{{{order}}}${', as claimed' if claimed else ''}"
        slope_guide(axis, order, span, errors[points][np.argmin(steps[points])], label)
    axis.legend(frameon=False)


def _energy(axis: Any, ledger: Ledger) -> None:
    traces, finding = ledger.traces, ledger["energy"]
    unit, scale = "nutations", "nutation's energy"
    if ledger.about.chart == BODY:
        unit, scale = "natural periods", "kinetic energy and |mgl|"
    title = f"energy: {finding.measured or 'not measured'}"
    axis.set(title=title, xlabel=f"time ({unit})", ylabel=f"|change|, of the {scale}")
    times, change = (np.asarray(traces.get(name, [])) for name in ("long_nutations", "energy_change"))
    valid = np.isfinite(change) & np.isfinite(times)
    if not valid.any():
        _write_reason(axis, finding)
        return
    axis.plot(
        times[valid], np.maximum(change[valid], SMALLEST), color=ORANGE, label=f"{int(traces['steps_run'])} steps"
    )
    axis.set(xscale="log", yscale="log")
    if math.isfinite(finding.resolution):
        axis.axhline(finding.resolution, color=GREY, lw=0.9, ls=(0, (5, 3)), label="what rounding explains")
    axis.legend(frameon=False)


def _write_reason(axis: Any, finding: Finding) -> None:
    """Write the reason into a panel without points."""
    words = textwrap.fill(finding.why or "it was not measured", 44)
    axis.text(0.5, 0.5, words, ha="center", va="center", transform=axis.transAxes)
    axis.set(xticks=[], yticks=[])


def card(ledger: Ledger, path: str | Path) -> Path:
    """Write the card, an HTML page; SymtopError if `ledger` is not one of a step, or the file cannot be written."""
    if not isinstance(ledger, Ledger):
        raise SymtopError(f"a card needs a ledger, which symtop.judge returns, not {shown(ledger)}", "ledger")
    if not ledger.about.chart:
        raise SymtopError("a card shows a method: there is none of a trajectory")
    folder = Path(__file__).parent / "templates"
    page = environment(autoescape=True).get_template("card.html")
    text = page.render(
        css=(folder / "style.css").read_text(encoding="utf-8"),
        about=ledger.about,
        scene=ledger.scene,
        described=description(ledger.findings),
        badge=badge(ledger),
        drawings=[_as_svg(figure) for figure in figures(ledger)],
        rows=[
            row.plain() | {"verdict": f"{SIGNS[row.verdict]} {row.verdict}", "claim": claim_name(row.claim)}
            for row in ledger.findings
            if row.declared or row.verdict != "inapplicable"
        ],
    )
    return _write(text, path)


def badge(ledger: Ledger) -> str:
    """The badge as SVG: the method's properties in green, or its refuted claims in vermillion."""
    refuted = [claim_name(finding.claim) for finding in ledger.findings if finding.verdict == "refuted"]
    words = f"refuted: {', '.join(refuted)}" if refuted else description(ledger.findings).partition(";")[0]
    if len(words) > LONGEST_TEXT:
        words = words[:LONGEST_TEXT].rsplit(",", 1)[0]
    left, right = (round(len(text) * LETTER_WIDTH + 12) for text in ("symtop", words))
    template = environment(autoescape=True).get_template("badge.svg")
    return f"{template.render(left=left, right=right, words=words, color=VERMILLION if refuted else GREEN)}\n"


def write_badge(ledger: Ledger, path: str | Path) -> Path:
    """Write the badge as an SVG file; SymtopError if the folder cannot be written to."""
    return _write(badge(ledger), path)


def _write(text: str, path: str | Path) -> Path:
    target = file_path("path", path)
    netcdf.write_text(target, text)
    return target
