"""What notebooks show of the scenes."""

import symtop
from symtop.model.scenes import _Scenes


def test_the_scenes_are_a_dict_that_a_notebook_shows_as_a_table():
    scenes = symtop.scenes()
    html = scenes._repr_html_()
    assert isinstance(scenes, dict)
    assert all(f"<td>{name}</td>" in html for name in scenes)
    assert html.count("<tr") == len(scenes) + 1


def test_what_users_write_is_escaped_and_whole():
    purpose = "a < b & <script>, and a sentence that is longer than the fifty characters a table has by default"
    scene = symtop.Scene("mine", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0), 1.0, purpose)
    html = _Scenes({"mine": scene})._repr_html_()
    assert "a &lt; b &amp; &lt;script&gt;, and a sentence that is longer than the fifty characters" in html
    assert "<script>" not in html
