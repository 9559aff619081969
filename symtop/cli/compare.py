"""``symtop compare``: error against run time of some methods on one scene, as a table, a figure and a dataset."""

import math
from typing import TYPE_CHECKING, Any

import click

from symtop.cli.common import File, as_text, check_outputs, completing, json_option, plugin_option, say, table, warn
from symtop.core.progress import ticking

if TYPE_CHECKING:
    import xarray as xr

TARGETS = (1e-3, 1e-6, 1e-9)  # whose cheapest runs are shown


@click.command(short_help="Compare methods on one scene: error against run time.")
@click.argument("scene", shell_complete=completing("scenes"))
@click.argument("methods", nargs=-1, required=True, shell_complete=completing("integrators"))
@click.option("--quantity", default="axis", show_default=True, help="Error of what: axis, attitude, theta, energy, ...")
@click.option("--cost", default="time", show_default=True, help="time, or evaluations, and nothing is timed.")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--nutations", type=float, help="In place of a horizon: nutation periods.")
@click.option("--budget", type=float, help="Most force evaluations of a run; 3e6 by default, 5e4 of plain Python.")
@click.option("--output", "-o", type=File(), help="Write all runs to this netCDF file.")
@click.option("--figure", type=File(), help="Draw error against cost: .png, .svg or .pdf.")
@plugin_option
@json_option
def compare(
    scene: str, methods: tuple[str, ...], quantity: str, cost: str, horizon: float | None, nutations: float | None,
    budget: float | None, output: str | None, figure: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Compare METHODS on one SCENE: which is cheapest for an error of 1e-3, 1e-6 and 1e-9?

    A method is a name, or a variant such as rk4[angles]; without a chart it runs in the smallest one that shows the
    quantity. Each is run from coarse settings to fine ones, and its runs are timed against those of the others.

    \b
    symtop compare goldstein stormer-verlet midpoint rk4 dop853 taylor --figure c.png
    symtop compare spheroid strang "rk4[angles]" bullet --nutations 10 --cost evaluations --output c.nc
    """
    check_outputs(output=output, figure=figure)
    with ticking("loading"):
        from symtop.core import netcdf
        from symtop.measure.timing import NOISY
        from symtop.runner import compare as runner

    data = runner.compare(
        scene, methods, horizon=horizon, nutations=nutations, quantity=quantity, cost=cost, budget=budget
    )
    if output is not None:
        netcdf.write(data, output)
    if figure is not None:
        from symtop.report.plot import draw_compare

        draw_compare(data, figure)
    cells = {target: runner.cheapest(data, target).tolist() for target in TARGETS}
    if as_json:
        facts = {
            name: data.attrs[name] for name in ("scene", "quantity", "horizon", "nutations", "cost", "timed", "budget")
        }
        runs = [_record(data, k, target, cells[target][k]) for k in range(data.sizes["variant"]) for target in TARGETS]
        click.echo(as_text(facts | {"exact_seconds": data["exact_seconds"].item(), "cheapest": runs}))
        return
    timed = cost == "time"
    end, count = (data.attrs[name] for name in ("horizon", "nutations"))
    say(f"{scene} to t = {end:.6g} ({count:.3g} nutations): the cheapest run by {cost}")
    say(f"steps a nutation or tolerance{', time' if timed else ''}, force evaluations; largest error of {quantity}")
    rows = [
        [str(name), *(_cell(_record(data, k, target, cells[target][k]), timed) for target in TARGETS)]
        for k, name in enumerate(data["variant"].values)
    ]
    click.echo(table(["variant", *map("error {:.0e}".format, TARGETS)], rows))
    for k, name in enumerate(map(str, data["variant"].values)):
        for sentence in _remarks(data.isel(variant=k), runner.fails_from(data.isel(variant=k))):
            say(f"{name}: {sentence}")
    if timed:
        say(f"the exact motion takes {_time(data['exact_seconds'].item())}; time is that of a call of the solver alone")
        noisy = float((data["seconds_spread"] > NOISY).sum() / data["seconds_spread"].notnull().sum())
        if noisy > 0.5:
            warn("the machine is busy: times are the least of some, and most others took a quarter longer")
    for file in (output, figure):
        if file is not None:
            click.echo(f"written to {file}")


def _record(data: "xr.Dataset", variant: int, target: float, place: int) -> dict[str, Any]:
    """The cheapest run of a variant for a target, or why there is none."""
    cell = data.isel(variant=variant)
    record = {"variant": str(cell["variant"].item()), "target": target, "reached": place >= 0}
    if place < 0:
        return record | {"reason": str(cell["reached"].sel(target=target).item())}
    names = ("step_size", "tolerance", "steps_per_nutation", "error", "seconds", "seconds_spread", "force_evaluations")
    return record | {name: cell[name].values[place].item() for name in names}


def _cell(record: dict[str, Any], timed: bool) -> str:
    if not record["reached"]:
        return f"not: {record['reason']}"
    steps, tolerance = record["steps_per_nutation"], record["tolerance"]
    fixed, formula = not math.isnan(record["step_size"]), math.isnan(tolerance)
    setting = (f"{steps:.3g}" if steps < 1e3 else f"{steps:.0f}") if fixed else "-" if formula else f"{tolerance:.0e}"
    return f"{setting:>6} {_time(record['seconds']) if timed else '':>{7 * timed}} {record['force_evaluations']:.1e}"


def _time(seconds: float) -> str:
    unit, name = (1e6, "us") if seconds < 1e-3 else (1e3, "ms") if seconds < 1.0 else (1.0, "s")
    return f"{seconds * unit:.3g} {name}"


def _remarks(cell: "xr.Dataset", last: int) -> list[str]:
    """Where a variant fails, and what ended its runs before the finest target shown."""
    if cell["message"].item():
        return [str(cell["message"].item())]
    errors, sentences = cell["error"].where(cell["outcome"] == "ok"), []
    if last >= 0:
        how = str(cell["outcome"].values[last]).replace("_", " ")
        steps, tolerance = (cell[name].values[last] for name in ("steps_per_nutation", "tolerance"))
        setting = f"{steps:.3g} steps a nutation" if math.isnan(tolerance) else f"tolerance {tolerance:.0e}"
        sentences.append(f"fails at {setting}: {how}")
    reached = {target: str(cell["reached"].sel(target=target).item()) for target in TARGETS}
    if missed := {why for why in reached.values() if why != "met"}:
        least = float(errors.min()) if errors.notnull().any() else math.nan
        most = f", {cell['force_evaluations'].max().item():.1e} force evaluations" if "budget" in missed else ""
        sentences.append(f"the least error was {least:.1e}, and what ends it is {', '.join(sorted(missed))}{most}")
    return sentences
