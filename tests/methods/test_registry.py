"""What notebooks show of the registry."""

import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import symtop
from symtop.methods import gauss, registry


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


def test_two_threads_that_make_the_very_first_call_together_see_every_integrator(monkeypatch):
    built_in, barrier = gauss.built_in, Barrier(4)

    def slow():
        time.sleep(0.05)
        return built_in()

    def first_call(_):
        barrier.wait(10.0)
        return list(registry.integrators())

    names = list(registry.integrators())
    shipped = [name for name in names if registry.is_built_in(name)]
    monkeypatch.setattr(gauss, "built_in", slow)
    for name, empty in (("_registry", {}), ("_loaded", []), ("_announced", []), ("_shipped", set())):
        monkeypatch.setattr(registry, name, empty)
    with ThreadPoolExecutor(4) as pool:
        seen = list(pool.map(first_call, range(4)))
    assert seen == [shipped] * 4
