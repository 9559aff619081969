"""Every figure can be read in print: letters, colours, lines and names; a file has the pixels of savefig."""

import dataclasses
import math

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image
from symtop_studies.carry_over.figures import MARKS
from symtop_studies.claims.figures import SYMBOLS
from symtop_studies.engines.facts import ROUNDING
from symtop_studies.stability.figures import OUTCOMES
from symtop_studies.stability.many_verdicts import EARLY

import symtop
from symtop.core import netcdf
from symtop.judging.battery import CLAIMS
from symtop.judging.findings import claim_name
from symtop.methods.framework.registry import FAMILIES
from symtop.report import figures, formats, style
from symtop.runner import run as runner

MOST_LINES, MOST_ENTRIES = 10, 8
GREYS = 0.05  # of saturation: a line of less colour is drawn for context
SHOWN_BY_ORDER = ("engines", "oscillators", "truth")  # whose lines are coloured by what they are, not by method


def saturation(color) -> float:
    red, green, blue = to_rgb(color)
    return max(red, green, blue) - min(red, green, blue)


def least_text(figure) -> tuple[float, str]:
    """The smallest text of a figure in points, if the figure is printed `WIDTH` inches wide, and what it says."""
    figure.draw_without_rendering()
    texts = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    sizes = ((text.get_fontsize() * style.WIDTH / figure.get_figwidth(), text.get_text()) for text in texts)
    return min(sizes, default=(math.inf, ""))


def faults(name, figure) -> list[str]:
    """What keeps a figure from being read: nothing, of a good one."""
    problems = []
    least, text = least_text(figure)
    if least < style.LEAST_TEXT - 1e-9:
        problems.append(f"{text!r} has {least:.1f} points")
    if not figure.get_suptitle() and runner.file_beside(name, "page.md") is None:  # a template has the titles
        problems.append("no message")
    legends = [*figure.legends, *(axis.get_legend() for axis in figure.axes if axis.get_legend())]
    lines = [sum(isinstance(entry, Line2D) for entry in key.legend_handles) for key in legends]  # a map has patches
    if (count := max(lines, default=0)) > MOST_ENTRIES and name not in SHOWN_BY_ORDER:
        problems.append(f"a legend of {count} entries")
    for axis in figure.axes if name not in SHOWN_BY_ORDER else []:
        kinds = {line.get_label() for line in axis.get_lines() if saturation(line.get_color()) > GREYS}
        if len(kinds - {label for label in kinds if label.startswith("_")}) > MOST_LINES:
            problems.append(f"{len(kinds)} coloured lines")
    return problems


@pytest.mark.parametrize("name", runner.names())
def test_every_figure_can_be_read_in_print(name, quick_results):
    data, study = netcdf.read_any(quick_results / f"{name}.nc"), runner.load(name)
    pictures = [picture for picture in study.pictures(data) if not hasattr(picture.figure, "suffix")]
    assert pictures or study.facts(data)["busy"]  # times of a busy machine are not drawn
    assert {entry.name: faults(name, entry.figure) for entry in pictures} == {entry.name: [] for entry in pictures}
    assert all(picture.figure.get_figwidth() <= style.WIDTH for picture in pictures)
    assert all(picture.figure.get_figheight() <= 10.0 for picture in pictures)  # inches: a page


def shows(drawn, groups, variant) -> bool:
    """Are all of these numbers, but those too small to draw, among those of a variant, whatever their signs?"""
    parts = (group.sel(variant=variant).data_vars.values() for group in groups if variant in group["variant"].values)
    numbers = [column.values.ravel() for part in parts for column in part if column.dtype.kind == "f"]
    return bool(np.isin(drawn[drawn > figures.SMALLEST], np.abs(np.concatenate(numbers))).all())


@pytest.mark.parametrize("name", ["convergence", "drift", "reduction", "oscillators", "notebook", "stability"])
def test_a_line_named_after_a_variant_shows_its_numbers_and_no_others(name, quick_results):
    data = netcdf.read_any(quick_results / f"{name}.nc")
    groups = [group for group in netcdf.groups(data).values() if "variant" in group.coords]
    variants = {str(variant) for group in groups for variant in group["variant"].values}
    axes = [axis for picture in runner.load(name).pictures(data) for axis in picture.figure.axes]
    drawn = [(axis.get_ylabel(), line) for axis in axes for line in axis.lines]
    named = [(np.abs(line.get_xdata() if "lambda" in label else line.get_ydata()),  # scaled times: see the other side
              line.get_label().rpartition(", ")[2]) for label, line in drawn]  # fmt: skip
    named = [(values, variant) for values, variant in named if variant in variants]
    assert [variant for values, variant in named if not shows(values, groups, variant)] == []
    large = [(values, variant) for values, variant in named if np.unique(values[values > 1e-14]).size > 1]
    assert large  # rounding, or a bound that many reach, is often the same
    assert not any(shows(values, groups, min(variants - {variant})) for values, variant in large)


def tables_and_axes(name, folder):
    """The tables of a study, and the axes of its figures."""
    data, study = netcdf.read_any(folder / f"{name}.nc"), runner.load(name)
    return dict(study.tables(data)), {picture.name: picture.figure.axes for picture in study.pictures(data)}


def test_points_of_carry_over_are_numbers_of_its_tables(quick_results):
    tables, axes = tables_and_axes("carry_over", quick_results)
    ranked = tables["rankings"].query("runs == 'short' and quantity == 'axis'")
    points = {line.get_label(): line.get_ydata() for line in axes["rankings"][0].lines}
    for decades, mark in zip((3, 6, 9), MARKS, strict=True):
        tau, part = (frame[np.isclose(frame["error"], 10.0**-decades)] for frame in (ranked, tables["steps"]))
        assert np.array_equal(points[f"axis to 1e-{decades} rad"], tau["tau"], equal_nan=True)
        marked = (line for line in axes["steps"][0].lines if line.get_marker() == mark and line.get_ydata().size)
        dots = {round(line.get_xdata().mean()): line.get_ydata() for line in marked}
        for place, family in enumerate(part.columns[4:]):
            assert sorted(dots.get(place, [])) == sorted(part[family].fillna(math.inf)), family


def test_counts_of_the_ledger_are_those_of_its_table(quick_results):
    tables, axes = tables_and_axes("claims", quick_results)
    names = [name for name in FAMILIES if name in tables["ledger"]["family"].values]
    counts = tables["ledger"].value_counts(["family", "claim", "verdict"]).to_dict()
    texts = [(*text.get_position(), text.get_text().split()) for text in axes["ledger"][0].texts]
    verdicts = {symbol: verdict for verdict, symbol in SYMBOLS.items()}
    drawn = {(names[column], claim_name(CLAIMS[line]), verdicts[word[-1]]): int(word[:-1])
             for column, line, words in texts if column < len(names) for word in words}  # fmt: skip
    assert drawn == counts


def test_orders_beside_the_lines_of_oscillators_are_those_of_the_table(quick_results):
    tables, axes = tables_and_axes("oscillators", quick_results)
    orders = tables["damped"].set_index(["b", "rule"])
    for axis in axes["orders"]:
        title, _, damping = axis.get_title().partition("\nb = ")
        column = "order of x" if title.startswith("position") else "order of the rate of decay"
        for rule, _, order in (text.get_text().partition(": order ") for text in axis.texts):
            key = float(damping.partition(",")[0]), rule.replace(" ", "-")
            assert float(order) == round(orders.loc[key, column], 1)


def test_cells_of_the_atlas_have_the_shares_of_its_table(quick_results):
    tables, axes = tables_and_axes("stability", quick_results)
    maps, table = [axis for axis in axes["atlas"] if axis.images], tables["atlas"].set_index("variant")
    assert len(maps) >= 9
    for axis in maps:
        name, _, share = axis.get_title().replace("\n", "").partition(" accurate ")
        cells, row = np.array(list(OUTCOMES))[np.asarray(axis.images[0].get_array())], table.loc[name]
        assert 100.0 * np.char.startswith(cells, "accurate").mean() == pytest.approx(row["accurate (%)"])
        assert 100.0 * (cells == EARLY).mean() == pytest.approx(row["ended early (%)"])
        assert share == f"{row['accurate (%)']:.0f} %"


@pytest.mark.parametrize(("name", "picture", "table", "columns", "rows"), [
    ("cost", "accuracy", "winners", ["time (us)", "error"],
     "tops == 'natural' and nutations == 10.0 and needs in ('derivative', 'any body')"),
    ("engines", "error", "maps", ["at steps a nutation", "least error (rad)"],
     f"`least error (rad)` >= {ROUNDING}"),
])  # fmt: skip
def test_numbers_of_a_table_are_points_of_the_figure(name, picture, table, columns, rows, quick_results):
    tables, axes = tables_and_axes(name, quick_results)
    points = tables[table].query(rows)[columns].dropna().to_numpy()
    lines = [line.get_xydata() for line in axes[picture][0].lines if len(line.get_xdata())]
    hits = [np.isclose(np.concatenate(lines), point, rtol=1e-12, atol=0.0).all(axis=1).any() for point in points]
    assert (len(hits) >= 4, all(hits)) == (True, True)


def test_a_figure_that_cannot_be_read_is_found(monkeypatch):
    monkeypatch.setattr(runner, "file_beside", lambda *_: None)  # as of a study without a template
    figure, axes = style.panels(1, 1)
    axes[0, 0].plot([0.0, 1.0], [0.0, 1.0], label="one")
    style.headline(figure, "A message")
    assert faults("factors", figure) == []
    axes[0, 0].text(0.5, 0.5, "small", fontsize=6.0)
    assert faults("factors", figure) == ["'small' has 6.0 points"]
    figure.set_figwidth(13.0)  # twice the width is half the size in print
    assert faults("factors", figure)[0] == "'small' has 3.0 points"
    for k in range(11):
        axes[0, 0].plot([0.0, k], color="C0", label=f"line {k}")
    style.legend_below(figure, axes)
    assert {"a legend of 12 entries", "12 coloured lines"} <= set(faults("factors", figure))
    style.slope_guide(axes[0, 0], 2.0, (1.0, 10.0), 1e-3, "order 2")
    assert axes[0, 0].get_lines()[-1].get_ydata() == pytest.approx([1e-3, 1e-1])
    figure.suptitle("")
    assert "no message" in faults("factors", figure)


def contrast(color) -> float:
    """Of a colour on white, as WCAG 2 defines it."""
    part = np.array(to_rgb(color))
    linear = np.where(part <= 0.04045, part / 12.92, ((part + 0.055) / 1.055) ** 2.4)
    return 1.05 / (float(linear @ np.array([0.2126, 0.7152, 0.0722])) + 0.05)


def test_letters_have_the_contrast_that_letters_need():
    colors = {style.look(name).color for name in symtop.integrators()} | {style.YELLOW}
    assert min(map(contrast, colors)) < 2.0  # as they are, not all could be read
    assert min(contrast(style.ink(color)) for color in colors) >= 4.5
    assert style.ink(style.BLUE) == pytest.approx(to_rgb(style.BLUE))  # dark enough as it is


@pytest.mark.parametrize("places", [[0.5] * 10, [0.0, 0.01, 0.99, 1.0, 1.0], [0.2, 0.9, 0.4]])
def test_labels_keep_their_order_and_their_distance(places):
    placed = figures.keep_apart(places, 0.05)
    assert np.all(np.diff(np.sort(placed)) >= 0.05 - 1e-12)
    assert max(placed) <= 1.0 + 1e-12
    for i, j in ((0, 1), (1, 2)):
        assert (places[i] < places[j]) <= (placed[i] < placed[j])
    assert figures.keep_apart([0.1, 0.5], 0.05) == [0.1, 0.5]


@pytest.mark.parametrize(("value", "text"), [
    (1e-6, "10⁻⁶"), (1.4e-13, "1.4 × 10⁻¹³"), (0.0123, "0.012"), (185.3, "185"), (1093.0, "1093"),
    (30012.0, "3 × 10⁴"), (7.0, "7"), (99.4, "99"), (99.6, "100"), (-99.6, "-100"), (9999.7, "10⁴"),
])  # fmt: skip
def test_a_number_of_a_title(value, text):
    assert formats.number(value) == text.replace(" ", formats.NO_BREAK)
    assert formats.typeset("1e-06 (us), `1e-6 us`, [x](1e-3), 2 us, us") == "10⁻⁶ (µs), `1e-6 us`, [x](1e-3), 2 µs, us"
    assert [formats.at_most(number) for number in (1.249, 1.2, 0.1, 185.3)] == ["1.3", "1.2", "0.1", "190"]
    assert [formats.at_least(number) for number in (0.958, 0.95, 185.3)] == ["0.95", "0.95", "180"]


def test_a_published_figure_has_a_vector_beside_it_and_the_same_bytes_again(tmp_path):
    files = []
    for folder in ("one", "two"):
        figure, axes = style.panels(1, 1)
        axes[0, 0].plot([1.0, 2.0])
        style.publish(figure, tmp_path / folder / "a.png")
        files.append([(tmp_path / folder / f"a.{kind}").read_bytes() for kind in ("png", "pdf")])
    assert files[0] == files[1]
    assert files[0][1].startswith(b"%PDF")
    assert np.frombuffer(files[0][0][16:24], ">u4")[0] == round(style.WIDTH * style.DPI)


def test_no_two_integrators_look_alike_and_a_formula_has_one_colour():
    looks = [(style.look(name).color, style.look(name).marker) for name in symtop.integrators()]
    assert len(set(looks)) == len(looks)
    colors = {}
    for name in symtop.integrators():
        colors.setdefault(name.replace("-compiled", "").removesuffix("-fixed"), set()).add(style.look(name).color)
    assert [formula for formula, names in colors.items() if len(names) > 1] == []
    assert [style.look(f"rk4[{chart}]").fill for chart in ("angles", "axis", "attitude")] == ["none", "full", "left"]
    assert len({*colors["vern9"], *colors["tsit5"], *colors["rk45"], *colors["dop853"], *colors["rk4"]}) == 5


@pytest.mark.parametrize("model", ["rk4", "strang", "midpoint", "rk45", "taylor", "exact"])
def test_an_added_integrator_has_a_look_of_its_own_and_changes_nobodys(clean_registry, model):
    before = {name: style.look(name) for name in symtop.integrators()}
    for name in ("heun-3", "ralston"):
        symtop.register(dataclasses.replace(symtop.integrator(model), name=name))
        assert style.look(name)[:2] not in {look[:2] for look in before.values()}
        before[name] = style.look(name)
    assert {name: style.look(name) for name in before} == before
    assert model != "rk4" or before["heun-3"].color in style.ORANGES


def sample_figure() -> Figure:
    """A figure with a layout, a legend, a shared axis and a formula."""
    figure, axes = style.panels(1, 2, sharey=True)
    for k, axis in enumerate(axes.flat):
        axis.loglog([1.0, 10.0, 100.0], [1e-3, 1e-5, 10.0 ** -(k + 6)], **style.line("rk4"), label=rf"$x^{k}$")
        axis.set(title=f"panel {k}", ylabel="error")
    style.few_ticks(*axes.flat)
    style.legend_below(figure, axes)
    style.headline(figure, "A message above all panels that is long enough for a second line of letters " * 2)
    return figure


def pixels(path, mode: str) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture.convert(mode))


@pytest.mark.parametrize(("write", "dpi"), [
    (style.sketch, style.QUICK_DPI), pytest.param(style.publish, style.DPI, marks=pytest.mark.slow)])  # fmt: skip
def test_a_picture_has_the_pixels_of_savefig(tmp_path, write, dpi):
    write(sample_figure(), tmp_path / "a.png")
    sample_figure().savefig(tmp_path / "b.png", dpi=dpi)
    assert np.array_equal(pixels(tmp_path / "a.png", "RGBA"), pixels(tmp_path / "b.png", "RGBA"))
