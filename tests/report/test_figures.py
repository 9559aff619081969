"""Every figure of every study can be read in print: letters, colours, lines and names; and the instruments of that."""

import math

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.text import Text

import symtop
from symtop.core import netcdf
from symtop.report import figures, formats, style
from symtop.runner import run as runner

MOST_LINES, MOST_ENTRIES = 10, 8
GREYS = 0.05  # of saturation: a line of less colour is drawn for context
KEYED = ("stability",)  # whose maps have a key of colours, not names of lines
SHOWN_BY_ORDER = ("engines", "oscillators", "truth")  # whose lines are coloured by what they are, not by method


def saturation(color) -> float:
    red, green, blue = to_rgb(color)
    return max(red, green, blue) - min(red, green, blue)


def least_text(figure) -> tuple[float, str]:
    """The smallest text of a figure in points, if the figure is printed `WIDTH` inches wide, and what it says."""
    figure.draw_without_rendering()
    texts = [one for one in figure.findobj(Text) if one.get_visible() and one.get_text().strip()]
    sizes = ((one.get_fontsize() * style.WIDTH / figure.get_figwidth(), one.get_text()) for one in texts)
    return min(sizes, default=(math.inf, ""))


def faults(name, figure) -> list[str]:
    """What keeps a figure from being read: nothing, of a good one."""
    problems = []
    least, text = least_text(figure)
    if least < style.LEAST_TEXT - 1e-9:
        problems.append(f"{text!r} has {least:.1f} points")
    if (
        not figure.get_suptitle() and runner.file_beside(name, "page.md") is None
    ):  # a template has the titles of its figures
        problems.append("no message")
    legends = [*figure.legends, *(axis.get_legend() for axis in figure.axes if axis.get_legend())]
    most = max((len(one.get_texts()) for one in legends), default=0)
    if most > MOST_ENTRIES and name not in (*SHOWN_BY_ORDER, *KEYED):
        problems.append(f"a legend of {most} entries")
    for axis in figure.axes if name not in SHOWN_BY_ORDER else []:
        kinds = {line.get_label() for line in axis.get_lines() if saturation(line.get_color()) > GREYS}
        if len(kinds - {label for label in kinds if label.startswith("_")}) > MOST_LINES:
            problems.append(f"{len(kinds)} coloured lines")
    return problems


@pytest.mark.parametrize("name", runner.names())
def test_every_figure_can_be_read_in_print(name, quick_results):
    data = netcdf.read_any(quick_results / f"{name}.nc")
    study = runner.load(name)
    pictures = [one for one in study.pictures(data) if not hasattr(one.figure, "suffix")]
    assert pictures or study.facts(data)["busy"]  # times of a busy machine are not drawn
    assert {one.name: faults(name, one.figure) for one in pictures} == {one.name: [] for one in pictures}
    assert all(one.figure.get_figwidth() <= style.WIDTH for one in pictures)
    assert all(one.figure.get_figheight() <= 10.0 for one in pictures)  # inches: a page


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
    placed = figures.spread(places, 0.05)
    assert np.all(np.diff(np.sort(placed)) >= 0.05 - 1e-12)
    assert max(placed) <= 1.0 + 1e-12
    for one, other in ((0, 1), (1, 2)):
        assert (places[one] < places[other]) <= (placed[one] < placed[other])
    assert figures.spread([0.1, 0.5], 0.05) == [0.1, 0.5]


@pytest.mark.parametrize(("value", "text"), [
    (1e-6, "10⁻⁶"), (1.4e-13, "1.4 × 10⁻¹³"), (0.0123, "0.012"), (185.3, "185"), (1093.0, "1093"),
    (30012.0, "3 × 10⁴"), (7.0, "7"), (99.4, "99"), (99.6, "100"), (-99.6, "-100"), (9999.7, "10⁴"),
])  # fmt: skip
def test_a_number_of_a_title(value, text):
    assert formats.number(value).replace(formats.FIRM, " ") == text
    assert " " not in formats.number(value)


def test_a_published_figure_has_a_vector_beside_it_and_the_same_bytes_again(tmp_path):
    files = []
    for folder in ("one", "two"):
        figure, axes = style.panels(1, 1)
        axes[0, 0].plot([1.0, 2.0])
        style.publish(figure, tmp_path / folder / "a.png")
        files.append([(tmp_path / folder / f"a.{kind}").read_bytes() for kind in ("png", "pdf")])
    assert files[0] == files[1]
    assert files[0][1].startswith(b"%PDF")
    with_pixels = np.frombuffer(files[0][0][16:24], ">u4")
    assert with_pixels[0] == round(style.WIDTH * style.DPI)
