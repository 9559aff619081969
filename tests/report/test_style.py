"""Figures keep the colour of every integrator, whatever else is in the picture."""

import numpy as np
from PIL import Image

import symtop
from symtop.report import style


def test_a_compacted_picture_keeps_the_colour_of_a_small_marker(tmp_path):
    """A busy picture with one dot of each integrator's colour: 256 colours chosen by area alone would lose some."""
    noise = np.random.default_rng(0).integers(0, 256, (300, 300, 3), dtype=np.uint8)
    colors = sorted({style.look(name).color for name in symtop.integrators()})
    for k, color in enumerate(colors):
        noise[5 * k : 5 * k + 3, :3] = [int(color[i : i + 2], 16) for i in (1, 3, 5)]
    noise[200:] = 252
    noise[250:] = 255
    path = tmp_path / "busy.png"
    Image.fromarray(noise).save(path)
    style.compact(path)
    after = np.asarray(Image.open(path).convert("RGB"))
    for k in range(len(colors)):
        assert np.array_equal(after[5 * k, 0], noise[5 * k, 0])
    assert np.array_equal(after[-1, -1], [255, 255, 255])  # and paper stays white beside nearly white
    by_area = np.asarray(Image.fromarray(noise).quantize(256).convert("RGB"))
    assert any(not np.array_equal(by_area[5 * k, 0], noise[5 * k, 0]) for k in range(len(colors)))


def test_no_two_integrators_look_alike():
    looks = [(style.look(name).color, style.look(name).marker) for name in symtop.integrators()]
    assert len(set(looks)) == len(looks)
