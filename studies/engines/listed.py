"""The tables of the study of engines: the steps in use, the same cost, orders and shares, and what engines say."""

import math
from typing import Any

import xarray as xr

from symtop.methods.registry import integrator
from symtop.runner.study import Table

from . import words
from .documentation import STATEMENTS
from .tables import FREQUENCIES, HORIZON, SCENES


def tables(data: xr.DataTree) -> list[Table]:
    """All of them."""
    return [used(data), same_cost(data), kinds(data), said()]


def used(data: xr.DataTree) -> Table:
    """Errors at the steps that people use, after a short time and a long one."""

    def shown(scene: str, row: str, rate: float) -> list[str]:
        def cell(name: str, form: str, *, long: bool) -> str:
            value = words.frame(data, row, name, rate, scene=scene, long=long)
            return format(value, form) if math.isfinite(value) else "ended early"

        forces = words.frame(data, row, "forces", rate, scene=scene) / HORIZON
        short = [
            cell("axis", ".1e", long=False),
            *(cell(name, "+.1e", long=False) for name in ("energy", "precession")),
        ]
        changes = [cell(name, "+.1e", long=True) for name in ("energy", "spin", "precession")]
        return [scene, row, f"1/{rate:g}", f"{forces:.0f}", *short, cell("axis", ".1e", long=True), *changes]

    long = f"{words.seconds(data):g} s"
    header = [
        "scene", "row", "step (s)", "forces a second",
        *(f"{name}, {HORIZON:g} s" for name in ("axis", "energy", "precession")),
        *(f"{name}, {long}" for name in ("axis", "energy", "spin", "precession")),
    ]  # fmt: skip
    rows = [shown(scene, row, rate) for scene in SCENES for row in words.rows(data) for rate in FREQUENCIES]
    return Table("At the steps that people use", header, rows)


def same_cost(data: xr.DataTree) -> Table:
    """The axis error at as many evaluations of the torque."""
    header = [
        "row", "evaluations a step",
        *(f"{scene}, {rate:g} a second, {time:g} s" for scene in SCENES for rate in FREQUENCIES
          for time in (HORIZON, words.seconds(data))),
    ]  # fmt: skip
    rows = []
    for row in words.rows(data):
        forces = float(data["tops"]["forces_a_step"].sel(scene=words.SLOW, integrator=row))
        off = [
            words.level(data, row, rate, scene=scene, long=long)
            for scene in SCENES for rate in FREQUENCIES for long in (False, True)
        ]  # fmt: skip
        rows.append([row, f"{forces:g}", *(f"{value:.1e}" for value in off)])
    return Table("Axis error (rad) with the same number of evaluations of the torque", header, rows)


def kinds(data: xr.DataTree) -> Table:
    """Order, least error and share of the population."""
    rows: list[list[str]] = []
    for row in words.rows(data):
        known: Any = words.facts(data, row)
        rows.append([
            row, integrator(row).summary, f"{known.order:.2f}", f"{known.best:.1e}", f"{known.best_count:,.0f}",
            f"{words.share(data, row):.0%}",
        ])  # fmt: skip
    title = (
        f"Order and least error on {words.SLOW}, and the share of the population within 5 degrees at "
        f"1/{words.USUAL:g} s"
    )
    header = ["row", "what it is", "order", "least axis error (rad)", "at steps a nutation", "share"]
    return Table(title, header, rows)


def said() -> Table:
    """What the engines' own documentation says."""
    return Table(
        "What the documentation of the engines says of it",
        ["engine", "what it says", "source"],
        [list(statement) for statement in STATEMENTS],
    )
