"""``symtop compare``: error against run time of some methods on one scene, as a table, a figure and a dataset."""

import math
from typing import TYPE_CHECKING, Any

import click

from symtop.cli.common import File, as_text, check_outputs, completing, say, say_written, scene_options, table, warn
from symtop.core.progress import showing_seconds

if TYPE_CHECKING:
    import xarray as xr

TARGETS = (1e-3, 1e-6, 1e-9)  # errors for which the cheapest runs are printed
ATTRIBUTES = ("quantity", "horizon", "nutations", "cost", "timed", "budget")
COLUMNS = ("step_size", "tolerance", "steps_per_nutation", "error", "seconds", "seconds_spread", "force_evaluations")


@click.command(short_help="Compare methods on one scene: error against run time.")
@click.argument("scene", shell_complete=completing("all scenes"))
@click.argument("methods", nargs=-1, required=True, shell_complete=completing("integrators"))
@click.option("--quantity", default="axis", show_default=True, help="Error of what: axis, attitude, theta, energy, ...")
@click.option("--cost", default="time", show_default=True, help="time, or evaluations, and nothing is timed.")
@click.option("--horizon", type=float, help="Time to run to; the scene's own by default.")
@click.option("--nutations", type=float, help="In place of a horizon: nutation periods.")
@click.option("--budget", type=float, help="Most force evaluations of a run; 3e6 by default, 5e4 of plain Python.")
@click.option("--output", "-o", type=File(), help="Write all runs to this netCDF file.")
@click.option("--figure", type=File(), help="Draw error against cost: .png, .svg or .pdf.")
@scene_options
def compare(
    scene: Any, methods: tuple[str, ...], output: str | None, figure: str | None, as_json: bool, **options: Any
) -> None:
    """Compare METHODS on one SCENE: which is cheapest for an error of 1e-3, 1e-6 and 1e-9?

    A method is a name, or a variant such as rk4[angles]; without a chart it runs in the smallest one that shows the
    quantity. Steps of your own are FILE.py:NAME and FILE.so, of those that symtop judge takes without --form, such as
    a function step(f, t, y, h). Each is run from coarse settings to fine ones, and its runs are timed against those of
    the others.

    \b
    symtop compare goldstein stormer-verlet midpoint rk4 dop853 taylor --figure c.png
    symtop compare spheroid strang "rk4[angles]" bullet --nutations 10 --cost evaluations --output c.nc
    symtop compare spheroid my.py:step rk4
    """
    check_outputs(output=output, figure=figure)
    with showing_seconds("loading"):
        from symtop.core import netcdf
        from symtop.judging import comparison
        from symtop.judging.findings import as_time
        from symtop.measure.sweep import failed_setting, period_word, titled
        from symtop.measure.timing import NOISY_SPREAD

    data = comparison.compare(scene, methods, **options)
    if output is not None:
        netcdf.write(data, output)
    if figure is not None:
        from symtop.report.plot import draw_compare

        draw_compare(data, figure)
    indices = {target: comparison.cheapest(data, target).tolist() for target in TARGETS}
    cells = [data.isel(variant=k) for k in range(data.sizes["variant"])]
    records = [[_record(cell, target, indices[target][k]) for target in TARGETS] for k, cell in enumerate(cells)]
    exact = data["exact_seconds"].item()  # NaN for a body without symmetry
    if as_json:
        facts = {name: data.attrs[name] for name in ATTRIBUTES}
        flat = [record for row in records for record in row]
        click.echo(as_text({"scene": data["scene"].item(), **facts, "exact_seconds": exact, "cheapest": flat}))
        return
    timed, end, count = options["cost"] == "time", data.attrs["horizon"], data.attrs["nutations"]
    unit, period = " s" if data["reached_time"].attrs["units"] == "s" else "", period_word(data)
    number = f"{count:.3g}"
    span = f" ({number} {period}{'s' * (number != '1')})" if count > 0.0 else ""  # 0: a separatrix
    say(f"{data['scene'].item()} to t = {end:.6g}{unit}{span}: the cheapest run by {options['cost']}")
    cost = "time" if timed else "force evaluations"
    say(f"steps a {period} or tolerance (tol), {cost}; error of {data.attrs['quantity']}")
    rows = [[titled(cell), *(_cell(record, timed) for record in row)] for cell, row in zip(cells, records, strict=True)]
    click.echo(table(["variant", *map("error {:.0e}".format, TARGETS)], rows))
    for cell in cells:
        smallest = cell["error"].min().item()
        words = [str(message) for message in cell["message"].values if message][:1] or [failed_setting(cell)]
        words += [f"its least error was {smallest:.1e}"] if smallest > TARGETS[-1] else []
        if any(words):
            say(f"{cell['variant'].item()}: {'; '.join(filter(None, words))}")
    if timed:
        motion = f"The exact motion takes {as_time(exact)}. " if math.isfinite(exact) else ""
        say(f"{motion}A time is that of one call of the solver, with nothing around it.")
        if float((data["seconds_spread"] > NOISY_SPREAD).sum() / data["seconds_spread"].notnull().sum()) > 0.5:
            warn("the machine is busy: times are the least of some, and most others took a quarter longer")
    say_written(output, figure)


def _record(cell: "xr.Dataset", target: float, index: int) -> dict[str, Any]:
    """The cheapest run of a variant for a target, or the reason why there is none, as a JSON record."""
    record = {"variant": str(cell["variant"].item()), "target": target, "reached": index >= 0}
    if index < 0:
        return record | {"reason": str(cell["reached"].sel(target=target).item())}
    return record | {name: cell[name].values[index].item() for name in COLUMNS}


def _cell(record: dict[str, Any], timed: bool) -> str:
    if not record["reached"]:
        return f"not: {record['reason']}"
    from symtop.judging.findings import as_time

    steps, tolerance = record["steps_per_nutation"], record["tolerance"]
    fixed, formula = not math.isnan(record["step_size"]), math.isnan(tolerance)
    count = f"{steps:.3g}" if steps < 999.5 else f"{steps:.0f}"
    setting = f"{count} steps" if fixed else "-" if formula else f"tol {tolerance:.0e}"
    return f"{setting:>10} {as_time(record['seconds']) if timed else format(record['force_evaluations'], '.1e'):>7}"
