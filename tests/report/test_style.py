"""Figures keep the colour of every integrator, whatever else is in the picture."""

import dataclasses

import numpy as np
import pytest
from PIL import Image

import symtop
from symtop.methods.framework import registry
from symtop.report import style


def test_a_compacted_picture_keeps_the_colour_of_a_small_marker():
    """A busy picture with one dot of each integrator's colour: 256 colours chosen by area alone would lose some."""
    noise = np.random.default_rng(0).integers(0, 256, (300, 300, 3), dtype=np.uint8)
    colors = sorted({style.look(name).color for name in symtop.integrators()})
    for k, color in enumerate(colors):
        noise[5 * k : 5 * k + 3, :3] = [int(color[i : i + 2], 16) for i in (1, 3, 5)]
    noise[200:] = 252
    noise[250:] = 255
    after = np.asarray(style.compact(Image.fromarray(noise)).convert("RGB"))
    for k in range(len(colors)):
        assert np.array_equal(after[5 * k, 0], noise[5 * k, 0])
    assert np.array_equal(after[-1, -1], [255, 255, 255])  # and paper stays white beside nearly white
    by_area = np.asarray(Image.fromarray(noise).quantize(256).convert("RGB"))
    assert any(not np.array_equal(by_area[5 * k, 0], noise[5 * k, 0]) for k in range(len(colors)))


def test_no_two_integrators_look_alike():
    looks = [(style.look(name).color, style.look(name).marker) for name in symtop.integrators()]
    assert len(set(looks)) == len(looks)


@pytest.fixture
def clean_registry(monkeypatch):
    monkeypatch.setattr(registry, "_registry", registry.integrators())  # a copy: what a test adds goes with it


@pytest.mark.parametrize("model", ["rk4", "strang", "midpoint", "rk45", "taylor", "exact"])
def test_an_added_integrator_changes_nobodys_look(clean_registry, model):
    before = {name: style.look(name) for name in symtop.integrators()}
    for name in ("heun-3", "ralston"):
        symtop.register(dataclasses.replace(symtop.integrator(model), name=name))
    assert {name: style.look(name) for name in before} == before


def test_an_added_integrator_has_a_look_of_its_own_whatever_else_was_added(clean_registry):
    symtop.register(dataclasses.replace(symtop.integrator("rk4"), name="heun-3"))
    alone = style.look("heun-3")
    assert (alone.color, alone.marker) not in {
        style.look(name)[:2] for name in symtop.integrators() if name != "heun-3"
    }
    assert alone.color in style.ORANGES
    symtop.register(dataclasses.replace(symtop.integrator("rk4"), name="bogacki-shampine"))
    assert style.look("heun-3") == alone
