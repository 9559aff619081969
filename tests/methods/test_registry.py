"""What notebooks show of the registry."""

import symtop


def test_the_registry_is_a_dict_that_a_notebook_shows_as_a_table():
    integrators = symtop.integrators()
    html = integrators._repr_html_()
    assert isinstance(integrators, dict)
    assert all(f"<td>{name}</td>" in html for name in integrators)
    assert html.count("<tr") == len(integrators) + 1
    assert all(
        integrator.summary.replace("'", "&#x27;") in html.replace("'", "&#x27;") for integrator in integrators.values()
    )


def test_a_record_says_every_claim_in_words():
    record = symtop.integrator("midpoint").record()
    assert (record["explicit"], record["symplectic"], record["order"]) == ("no", "yes", "2")
    assert record["conserves"] == "p_phi, p_psi"
    assert symtop.integrator("exact").record()["order"] == "unknown"
