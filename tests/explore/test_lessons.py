"""What a teacher shows: the map of outcomes, the stories, the link that restores a state; and a page under load."""

import json
import re

import numpy as np
import pytest

import symtop
from symtop.explore import answers
from symtop.explore.server import STATIC
from tests.browser import FAINT
from tests.explore.test_explore import STATUS, fields, set_control, unpack

SOURCE = (STATIC / "stories.js").read_text(encoding="utf-8")
RANGE = {"step_least": 0.01, "step_most": 0.6, "spin_least": -4.0, "spin_most": 4.0}


def test_a_cell_of_the_map_is_the_run_that_a_click_asks_for():
    setup, steps, spins = answers.grid(fields(**RANGE))
    errors = unpack(answers.outcome_map(setup, steps, spins)["error_rad"]).reshape(answers.ROWS, answers.COLUMNS)
    failures = 0
    for row, column in ((0, 0), (8, 10), (20, 20), (31, 47), (16, 47)):
        run = answers.answer(answers.setup(fields(step_size=steps[column], psi_dot=spins[row])))
        failures += run["outcome"] != "ok"
        assert np.isnan(errors[row, column]) == (run["outcome"] != "ok")
        if run["outcome"] == "ok":  # nine samples of the many of a run
            assert 0.2 * run["largest"]["axis_error"] < errors[row, column] < 1.001 * run["largest"]["axis_error"]
    assert 0 < failures < 5
    assert errors[8, 10] != pytest.approx(errors[20, 20], rel=0.01)
    for changes, word in (({"integrator": "rk45"}, "one with a step"), ({"step_least": 0.7}, "must not be empty")):
        with pytest.raises(symtop.SymtopError, match=word):
            answers.grid(fields(**RANGE | changes))


def text(browser, name):
    return browser.evaluate(f"document.querySelector('#{name}').textContent")


@pytest.mark.slow
def test_a_story_a_cell_and_a_link(explorer):
    browser = explorer()
    browser.wait_for("+document.body.dataset.maps > 0")
    set_control(browser, "#story", "resonance")
    browser.wait_for("document.querySelector('#status').textContent.startsWith('stormer-verlet: reached t = 20')")
    set_control(browser, "#step_size", 0.21)  # the step that the story names crosses the failure
    browser.wait_for("document.querySelector('#status').className === 'failed'")
    assert text(browser, "other").startswith("strang: reached t = 20")
    state = browser.evaluate("location.href")
    form = "[...document.querySelectorAll('input[type=number], #scene, #integrator, #second')].map((c) => c.value)"
    before, status = browser.evaluate(form), text(browser, "status").split(";")[0]
    set_control(browser, "#story", "pole jump")
    cut = "[...document.querySelectorAll('input[type=number]')].filter((c) => c.scrollWidth > c.clientWidth)"
    assert browser.evaluate("document.querySelector('#phi_dot').value") == "0.650635"
    assert browser.evaluate(f"{cut}.map((c) => c.value)") == []
    set_control(browser, "#story", "loop")
    assert browser.evaluate(form) != before
    browser.evaluate(f"location.href = {json.dumps(state)}")
    browser.wait_for(f"document.querySelector('#status').textContent.startsWith({json.dumps(status)})")
    assert browser.evaluate(form) == before
    browser.wait_for("document.querySelector('#map-note').textContent.startsWith('stormer-verlet')")
    (rate,) = re.findall(r"([\d,]+) runs a second$", text(browser, "map-note"))
    assert int(rate.replace(",", "")) > 0
    spin = browser.evaluate("document.querySelector('#psi_dot').value")
    browser.evaluate("document.querySelector('#map').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowDown'}))")
    assert browser.evaluate("+document.querySelector('#psi_dot').value") < float(spin)
    for scheme in ("light", "dark"):
        browser.prefer(scheme)
        for width in (1280, 390):
            browser.resize(width, 900)
            assert browser.too_wide == 0
    assert browser.outside() == []


@pytest.mark.slow
def test_a_hand_reaches_everything_and_every_text_can_be_read(explorer):
    browser = explorer()
    browser.resize(1280, 1400)
    browser.wait_for("+document.body.dataset.maps > 0")
    set_control(browser, "#second", "strang")
    for scheme in ("light", "dark"):
        browser.prefer(scheme)
        assert browser.evaluate(FAINT) == []
    browser.evaluate("document.querySelector('#purpose').style.color = '#555'")
    assert browser.evaluate(FAINT)  # the control: grey on dark
    browser.prefer("light")
    controls = "[...document.querySelectorAll('select, input, button, canvas[tabindex]')]"
    expected = browser.evaluate(f"{controls}.filter((c) => !c.disabled && c.checkVisibility()).length")
    browser.evaluate("document.activeElement.blur(); window.reached = new Set()")
    for _ in range(expected):
        browser.press("Tab")
        browser.evaluate("reached.add(document.activeElement) && true")
    assert browser.evaluate("reached.size") == expected > 20
    assert not browser.evaluate("reached.has(document.body)")
    before = browser.evaluate("document.querySelector('#step_size').value")
    count = browser.evaluate("+document.body.dataset.answers")
    browser.evaluate("document.querySelector('#map').scrollIntoView()")
    browser.drag("#map", xy=(0.3, 0.4))
    browser.wait_for(f"+document.body.dataset.answers > {count}")
    assert browser.evaluate("document.querySelector('#step_size').value") != before


def test_a_link_shows_what_it_changes_and_says_what_is_not_known(explorer):
    browser = explorer("#base=goldstein&scene=goldstein&integrator=rk45&tolerance=1e-9&theta=0.9")
    browser.wait_for(f"{STATUS}.startsWith('rk45: reached t = 70')")
    set_control(browser, "#second", "midpoint")
    controls = "[...document.querySelectorAll('#story, #scene option:checked, #step_size, #tolerance')].map((c) => "
    controls += "c.localName === 'option' ? c.text : c.value)"
    assert browser.evaluate(controls)[1::2] == ["goldstein (edited)", "1e-9"]  # a second method leaves the tolerance
    browser.set("#I3", 30)
    browser.wait_for(f"document.querySelector('#other').hidden && {STATUS}.includes('no rigid body')")
    set_control(browser, "#story", "cusp")
    set_control(browser, "#theta", 0.9)
    browser.click("#reset")
    assert browser.evaluate(controls)[:3] == ["cusp", "cusp", "0.33"]  # of the story
    browser.evaluate("location.hash = 'base=nowhere', history.replaceState(null, '', '#')")  # by an answer, meanwhile
    browser.wait_for("document.querySelector('#watch').textContent.includes('the scene nowhere is not known here')")
    assert browser.evaluate(controls)[0] == ""
    note = "document.querySelector('#map-note').textContent"
    choose = "scene.value = 'separatrix', scene.dispatchEvent(new Event('change'))"
    assert browser.evaluate(f"{choose}, {note}") == ""  # no map of another scene
    browser.wait_for(f"{note}.includes(' ended early')")  # although its nutation takes longer than its run
    before = browser.evaluate(note)
    browser.set("#horizon", 3)
    browser.wait_for(f"{note}.includes(' ended early') && {note} !== {before!r}")


SHOWN = r'\s+scene: "(.*?)", integrator: "(.*?)", second: "(.*?)", step_size: (.*?),'
STORIES = {  # the scene, the methods and the step of each in stories.js
    name: entry for name, *entry in re.findall(rf'^  "?([a-z -]+)"?: {{{SHOWN}', SOURCE, re.MULTILINE)
}


def answer_to(story, second=False, **changes):
    """The answer to what a story shows, of its first method or of its second."""
    scene, *methods, step = STORIES[story]
    return answers.answer(answers.setup(fields(scene, methods[second], **{"step_size": float(step)} | changes)))


@pytest.mark.parametrize(("story", "changes", "first"), [
    ("cusp", {}, True), ("cusp", {"step_size": 0.45}, False), ("pole jump", {}, False),
    ("resonance", {}, True), ("resonance", {"step_size": 0.21}, False),
])  # fmt: skip
def test_the_second_method_of_a_story_reaches_the_end_and_the_first_where_it_says_so(story, changes, first):
    assert [answer_to(story, second, **changes)["outcome"] == "ok" for second in (False, True)] == [first, True]


def test_what_stories_say_in_numbers():
    assert {*STORIES} == {"cusp", "loop", "sleeping", "pole jump", "resonance", "tennis-racket"}
    scenes = {story: symtop.scene(name, bodies=True) for story, (name, *_) in STORIES.items()}
    steps = {story: scenes[story].nutation_period / float(entry[-1]) for story, entry in STORIES.items()}
    assert (round(steps["cusp"]), round(steps["loop"])) == (4, 5)
    drifting, conserving = (answer_to("loop", second)["largest"] for second in (False, True))
    assert 0.05 < drifting["energy"] < 0.2
    assert conserving["energy"] < 1e-11
    assert conserving["axis_error"] == pytest.approx(0.02, abs=0.005)
    fallen = answer_to("sleeping")
    assert min(np.nanmax(unpack(fallen["arrays"]["theta"])), fallen["largest"]["axis_error"]) > 0.5
    for second in (False, True):
        assert np.nanmax(unpack(answer_to("sleeping", second, psi_dot=2.5)["arrays"]["theta"])) < 0.05
    pole = symtop.ClosedForm(scenes["pole jump"].top, scenes["pole jump"].start)
    assert np.degrees(pole.theta_range[0]) == pytest.approx(0.06, abs=0.005)
    assert scenes["resonance"].nutation_period / np.pi == pytest.approx(0.202, abs=5e-4)
    assert answer_to("resonance")["largest"]["axis_error"] < 1e-6


def test_what_the_story_of_the_tennis_racket_says():
    def flips(answer, name="middle"):
        time, along = (unpack(answer["arrays"][key]) for key in ("time", name))
        k = np.flatnonzero(along[:-1] * along[1:] < 0.0)
        return time[k] + (time[k + 1] - time[k]) * along[k] / (along[k] - along[k + 1])

    exact, times = [14.9, 42.4, 69.9, 97.5], [13.3, 37.7, 62.2, 86.7]
    reply, true_reply = answer_to("tennis-racket"), answer_to("tennis-racket", True)
    np.testing.assert_allclose(flips(true_reply, "true_middle"), exact, atol=0.1)
    np.testing.assert_allclose(flips(true_reply), exact, atol=0.1)
    np.testing.assert_allclose(flips(reply), times, atol=0.1)
    assert max(reply["largest"]["energy"], true_reply["largest"]["energy"]) < 1e-15
    assert flips(answer_to("tennis-racket", step_size=0.1))[-1] - exact[-1] == pytest.approx(-0.2, abs=0.1)
    assert symtop.scene("tennis-racket", bodies=True).nutation_period / 0.6 == pytest.approx(10.0, abs=0.6)


def test_a_body_is_two_bricks_side_by_side(explorer):
    browser = explorer()
    browser.wait_for("document.body.dataset.answer === 'ok'")
    browser.click("#play")
    set_control(browser, "#story", "tennis-racket")
    browser.wait_for("document.querySelector('#status').textContent.startsWith('lie-variational: reached t = 100')")
    visible = "document.querySelector('{}').checkVisibility()"
    for name, state in {"#plot-middle": True, "#I2": True, "#w2": True, "#map": False, "#theta": False}.items():
        assert browser.evaluate(visible.format(name)) is state, name
    before = browser.evaluate("document.querySelector('#sphere').toDataURL().length")
    set_control(browser, "#I1-slider", 0.2)  # and the sides of the bricks
    browser.wait_for(f"document.querySelector('#sphere').toDataURL().length !== {before}")
    assert browser.evaluate("document.querySelector('#scene').selectedOptions[0].text") == "tennis-racket (edited)"
    options = "[...document.querySelector('#integrator').options]"
    assert browser.evaluate(f"{options}.find((o) => o.value === 'midpoint').disabled")
    set_control(browser, "#scene", "goldstein")
    assert browser.evaluate(visible.format("#map"))
    assert not browser.evaluate(visible.format("#I2"))
    assert browser.evaluate("document.querySelector('#watch').textContent") == ""
