"""Which scenes the studies run: today's, whatever is added, and nothing that they leave out."""

import dataclasses

import pytest
from symtop_studies.grid import grid_scenes

import symtop
from symtop.model import scenes as catalogue
from symtop.model.scenes import TAGS
from symtop.runner.run import load

BUILT_IN = ("convergence", "drift", "claims")


def scenes_of(study: str, *, quick: bool = False) -> list[str]:
    return list(dict.fromkeys(case.scene for case in load(study).cases(quick)))


@pytest.fixture
def new_scene(monkeypatch):
    """A scene that somebody has added to the catalogue of the package."""
    scene = dataclasses.replace(symtop.scene("loop"), name="brand-new", tags=())
    known = catalogue._catalogue()
    monkeypatch.setattr(catalogue, "_catalogue", lambda: {**known, scene.name: scene})
    return scene


@pytest.mark.parametrize("study", BUILT_IN)
@pytest.mark.parametrize("quick", [False, True])
def test_a_scene_that_joins_the_catalogue_is_in_every_study(study, quick, new_scene):
    assert scenes_of(study, quick=quick)[-1] == new_scene.name


def test_a_scene_that_the_question_does_not_suit_stays_out():
    assert "separatrix" not in grid_scenes({}, lambda scene: scene.nutation_period < 70.0)
    assert "separatrix" in grid_scenes({})


def test_scenes_are_left_out_by_their_tags():
    assert grid_scenes(TAGS) == ["spheroid"]
    assert "loop" in grid_scenes({"steady": "no nutation"})
    assert "steady" not in grid_scenes({"steady": "no nutation"})
    with pytest.raises(symtop.SymtopError, match="left_out 'staedy' is unknown; did you mean steady"):
        grid_scenes({"staedy": "no nutation"})
