"""How a figure is written: drawn once for each file, as savefig draws it."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from symtop.report import style


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


@pytest.mark.parametrize(
    ("write", "dpi"), [(style.sketch, style.SKETCHED), pytest.param(style.publish, style.DPI, marks=pytest.mark.slow)]
)
def test_a_picture_has_the_pixels_of_savefig(tmp_path, write, dpi):
    write(sample_figure(), tmp_path / "a.png")
    sample_figure().savefig(tmp_path / "b.png", dpi=dpi)
    assert np.array_equal(pixels(tmp_path / "a.png", "RGBA"), pixels(tmp_path / "b.png", "RGBA"))
