"""What notebooks show."""

import symtop


def test_catalogues_are_dicts_that_show_every_record():
    for catalogue in (symtop.integrators(), symtop.scenes()):
        shown = catalogue._repr_html_()
        assert isinstance(catalogue, dict)
        assert all(f"<td>{name}</td>" in shown for name in catalogue)
        assert shown.count("<tr>") == len(catalogue) + 1


def test_records_show_their_numbers():
    assert "<td>26.8658</td>" in symtop.scene("spheroid").top._repr_html_()
    assert "<td>p_phi, p_psi</td>" in symtop.integrator("midpoint")._repr_html_()
    assert "0.4" in symtop.scene("spheroid")._repr_html_()


def test_what_users_write_is_escaped():
    scene = symtop.Scene("mine", symtop.SymmetricTop(1.0, 1.0, 1.0), symtop.Angles(1.0), 1.0, "a < b & <script>")
    assert "a &lt; b &amp; &lt;script&gt;" in scene._repr_html_()
    assert "<script>" not in scene._repr_html_()
