"""The card and the badge of a judged step."""

import os
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import symtop
from symtop.judging.findings import About, Finding, Ledger, Reading
from symtop.report.card import badge, card, figures, write_badge
from tests.judging.blind.right import midpoint
from tests.judging.conftest import shorten


@pytest.fixture(scope="module")
def ledger():
    with pytest.MonkeyPatch.context() as shorter:
        shorten(shorter)
        return symtop.judge(midpoint, quick=True, order=2, symplectic=True)


def handmade(*findings, name="mine"):
    return Ledger(name, "spheroid", findings, {}, About(name, "axis", "python", 0.0))


ORDER = Finding("order", "4", Reading(), "undecided", "no <luck>")
NOTHING = handmade(ORDER, Finding("energy", "", Reading(), "undecided", "it stopped"))


def test_the_card_is_one_page_with_every_verdict_and_the_energy_of_the_long_run(ledger, tmp_path):
    page = card(ledger, tmp_path / "card.html").read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="http', page.replace('xmlns:xlink="http', ""))
    assert page.count("<svg") == 3  # the badge, two drawings
    for finding in ledger.findings:
        if finding.verdict != "inapplicable":
            assert f" {finding.verdict}</td>" in page
    assert page.count('<td class="refuted">✗ refuted') == len(ledger.refuted) == 2
    data = ledger.dataset()
    assert float(data["energy_change"].max()) == pytest.approx(ledger["energy"].value, rel=0.02)
    assert float(data["long_nutations"].max()) == pytest.approx(float(data["nutations_run"]), rel=0.05)


@pytest.mark.parametrize(("chart", "unit", "scale"), [
    ("axis", "nutations", "nutation's energy"), ("body", "natural periods", "kinetic energy and |mgl|")])  # fmt: skip
def test_the_units_of_a_card_are_those_of_its_scene(chart, unit, scale, tmp_path):
    run = {"long_nutations": [1.0, 2.0], "energy_change": [1e-9, 2e-9], "steps_run": np.array(200)}
    energy = Finding("energy", "", Reading("drift", 2e-9), "measured", "it grows", 2e-9, 1e-11)
    findings, about = (ORDER, energy), About("mine", chart, "python", 0.0)
    ledger = Ledger("mine", "any", findings, {name: np.asarray(values) for name, values in run.items()}, about)
    axes = figures(ledger)[1].axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (f"time ({unit})", f"|change|, of the {scale}")
    of_body = "relative to the kinetic energy of the start" in card(ledger, tmp_path / "card.html").read_text("utf-8")
    assert of_body is (chart == "body")


def test_the_badge_says_what_is_refuted_or_what_the_method_is(ledger, tmp_path):
    root = ET.fromstring(write_badge(ledger, tmp_path / "badge.svg").read_text(encoding="utf-8"))
    words = [text.text for text in root.iter("{http://www.w3.org/2000/svg}text")]
    assert words == ["symtop", "refuted: symplectic, energy"]
    confirmed = Finding("order", "2", Reading("slope", 2.0, text="2.000 +- 0.001"), "confirmed", "a <b>", 2.0, 0.05)
    claim_ledger = handmade(confirmed, name="<mine>")
    assert "order 2" in badge(claim_ledger)
    assert "refuted" not in badge(claim_ledger)
    ET.fromstring(badge(claim_ledger))
    assert root.get("width").isdigit()


def test_a_card_without_measurements_says_why_and_one_that_cannot_be_written_is_told(tmp_path):
    page = card(NOTHING, tmp_path / "card.html").read_text(encoding="utf-8")
    assert ("no &lt;luck&gt;" in page, "<luck>" in page) == (True, False)
    assert [figure.axes[0].texts[0].get_text() for figure in figures(NOTHING)] == ["no <luck>", "it stopped"]
    os.mkfifo(pipe := tmp_path / "pipe.html")
    for path, words in ((tmp_path, "a folder"), (pipe, "a device or a pipe"), (3, "not 3"), (250 * "a", "not 'a")):
        with pytest.raises(symtop.SymtopError, match=words):
            card(NOTHING, path)
    for value in (3, None, {}, "card.html"):
        with pytest.raises(symtop.SymtopError, match=r"a card needs a ledger, which symtop\.judge returns, not "):
            symtop.card(value, tmp_path / "card.html")
