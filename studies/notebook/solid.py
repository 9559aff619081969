"""Drawings in three dimensions: paths of the axis on the unit sphere, the body-fixed triad, and a film of it."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from symtop.model.charts import Array, axis_from_quaternion
from symtop.report.style import BLACK, BLUE, GREEN, GREY, VERMILLION

TRIAD = (VERMILLION, GREEN, BLUE)  # body axes 1, 2 and 3


def sphere(axis: Any, label: str = "") -> None:
    """The unit sphere as a few circles, with the three coordinate discs."""
    turn = np.linspace(0.0, 2.0 * np.pi, 73)
    c, s, z = np.cos(turn), np.sin(turn), 0.0 * turn
    for x, y, w, color in ((z, c, s, VERMILLION), (c, z, s, GREEN), (c, s, z, BLUE)):
        axis.plot(x, y, w, color=color, lw=0.7, alpha=0.7)
        axis.plot_surface(*(np.outer([0.0, 1.0], part) for part in (x, y, w)), color=color, alpha=0.06, lw=0)
    for height in (-0.6, 0.6):
        radius = np.sqrt(1.0 - height * height)
        axis.plot(radius * c, radius * s, height + z, color=GREY, lw=0.4, alpha=0.6)
    axis.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), zlim=(-0.8, 0.8), title=label)
    axis.set_box_aspect((1.0, 1.0, 1.0), zoom=1.15)
    axis.set_axis_off()
    axis.view_init(elev=22.0, azim=-55.0)


def transverse_from_quaternion(quaternion: Array) -> Array:
    """The first column of the rotation matrix, a body-fixed axis across the top's, shape (..., 3)."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    return np.stack([w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=-1)


def columns_of(quaternion: Array) -> Array:
    """The three body axes in space, shape (..., 3, 3), the last index counting x, y, z."""
    third, first = axis_from_quaternion(quaternion), transverse_from_quaternion(quaternion)
    return np.stack([first, np.cross(third, first), third], axis=-2)


class Film(Figure):
    """A figure that saves itself as a GIF: the triad turning, the path of its tip, the truth as a ghost.

    `attitudes` and `ghosts` are quaternions, shape (frames, 4); `pause` is the time of a frame in milliseconds.
    """

    suffix = "gif"

    def __init__(self, attitudes: Array, ghosts: Array, title: str, pause: int = 40, pixels: int = 340) -> None:
        super().__init__(figsize=(pixels / 100.0, pixels / 100.0), dpi=100)
        self.set_layout_engine("none")
        self._bodies, self._ghosts = columns_of(attitudes), columns_of(ghosts)
        self._pause = pause
        axis: Any = self.add_axes((-0.06, -0.08, 1.12, 1.08), projection="3d")
        axis.computed_zorder = False  # the triad in front of its ghost, whatever the depth
        sphere(axis)
        self.text(0.5, 0.965, title, ha="center", va="center", fontsize=8.5)
        self._path = axis.plot([], [], [], color=BLACK, lw=0.9, zorder=4)[0]
        self._rods = [axis.plot([], [], [], color=color, lw=3.0, zorder=7)[0] for color in TRIAD]
        self._tails = [axis.plot([], [], [], color=color, lw=1.2, ls=":", zorder=6)[0] for color in TRIAD]
        self._ghost = [axis.plot([], [], [], color=GREY, lw=1.6, zorder=5)[0] for _ in TRIAD]

    def _draw(self, k: int) -> None:
        tips = self._bodies[: k + 1, 2]
        self._path.set_data_3d(*tips.T)
        for place, (rod, tail, ghost) in enumerate(zip(self._rods, self._tails, self._ghost, strict=True)):
            arm = self._bodies[k, place]
            rod.set_data_3d(*np.stack([0.0 * arm, arm], axis=-1))
            tail.set_data_3d(*np.stack([0.0 * arm, -0.7 * arm], axis=-1))
            ghost.set_data_3d(*np.stack([0.0 * arm, self._ghosts[k, place]], axis=-1))

    def savefig(self, fname: Any, **_: Any) -> None:
        """Write all frames with one palette of 32 colours, the triad's own among them."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from PIL import Image  # matplotlib brings it
        from PIL.ImageColor import getrgb

        canvas = FigureCanvasAgg(self)
        frames = []
        for k in range(len(self._bodies)):
            self._draw(k)
            canvas.draw()
            frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()))
        palette = Image.new("P", (1, 1))
        ours = [value for color in (*TRIAD, GREY, BLACK, "#FFFFFF") for value in getrgb(color)]
        palette.putpalette((ours + (frames[-1].quantize(26).getpalette() or []))[: 3 * 32])
        shown = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
        shown[0].save(
            fname, format="GIF", save_all=True, append_images=shown[1:], duration=self._pause, loop=0, optimize=True
        )
