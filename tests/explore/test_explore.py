"""The explorer: its answers are simulate's, its script gives the same bits, its page works in a browser."""

import base64
import http.client
import json
import re
import socket
import threading
import time
import warnings
from unittest.mock import Mock

import numpy as np
import pytest
from symtop_studies.oscillators.damping import damped_truth

import symtop
from symtop.core import netcdf
from symtop.core.errors import SymtopError, SymtopWarning
from symtop.explore import answers, cost
from symtop.measure.sweep import timed_rows
from symtop.methods.framework.registry import engines
from symtop.methods.lagrangian.damped_top import Friction
from symtop.model import charts
from symtop.model.scenes import closed_form
from symtop.run.simulation import integrate
from tests.commands import call
from tests.conftest import defer


def fields(name="spheroid", integrator="midpoint", **changes):
    """What the page sends for a scene of the catalogue."""
    entry = symtop.scene(name, bodies=True)
    numbers = {name: getattr(entry.top, name) for name in (answers.OF_BODY if entry.of_body else answers.TOP)}
    if entry.of_body:
        numbers |= {"base": name, **dict(zip(answers.RATES, entry.start.omega_body, strict=True))}
    else:
        numbers |= {name: getattr(entry.start, name) for name in answers.START}
    numbers |= {"horizon": entry.horizon, "integrator": integrator, "step_size": 0.02, "tolerance": 1e-6}
    return numbers | changes


def unpack(text):
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


@pytest.mark.parametrize("method", ["midpoint", "exact", *defer("gauss-4", "rk45")])
def test_an_answer_is_the_run_beside_the_truth(method):
    setup = answers.setup(fields(integrator=method))
    answer, run = answers.answer(setup), answers.dataset(setup, str)
    arrays = {name: unpack(text) for name, text in answer["arrays"].items()}
    assert np.array_equal(arrays["time"], run["time"].values.astype(np.float32))
    assert np.array_equal(arrays["theta"], run["theta"].values.astype(np.float32))
    truth = closed_form(setup.scene).quaternion(run["time"].values)
    assert np.array_equal(arrays["truth"].reshape(-1, 4), truth.astype(np.float32))
    error = charts.axis_distance(run["axis"].values, charts.axis_from_quaternion(truth))
    assert answer["largest"]["axis_error"] == error.max()
    assert np.array_equal(arrays["axis_error"], error.astype(np.float32))
    # the drawn attitude has the axis of the run
    axes = charts.axis_from_quaternion(arrays["attitude"].reshape(-1, 4).astype(float))
    assert np.max(charts.axis_distance(axes, run["axis"].values)) < 1e-6
    drift = np.abs(run["energy"].values - run["energy"].values[0]).max() / setup.scene.energy_scale
    assert np.max(np.abs(arrays["energy"])) == pytest.approx(drift, rel=1e-5)
    assert answer["outcome"] == "ok"


@pytest.mark.quick
def test_an_answer_on_a_body_is_the_run_beside_its_truth():
    setup = answers.setup(fields("heavy-brick", "rk4", I2=1.1, w3=2.5, horizon=4.0))
    assert setup.scene.top.centre == symtop.scene("heavy-brick", bodies=True).top.centre
    assert setup.scene.top.moments == (1.0, 1.1, 0.6)
    answer, run = answers.answer(setup), answers.dataset(setup, str)
    errors, truth = symtop.errors(run), symtop.reference(setup.scene, run["time"].values)
    assert answer["largest"]["attitude_error"] == pytest.approx(float(errors["attitude"].max()), rel=1e-6)
    assert np.array_equal(unpack(answer["arrays"]["truth"]).reshape(-1, 4), truth["quaternion"].astype(np.float32))
    moment = run["momentum"].values[7] / np.linalg.norm(run["momentum"].values[7])
    w, x, y, z = run["quaternion"].values[7]  # of the middle moment, I1, is the first axis
    first = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
    assert unpack(answer["arrays"]["middle"])[7] == pytest.approx(moment @ first, abs=1e-6)
    assert not {"p_psi", "p_theta"} & {*answer["arrays"]}
    long_step, blank = {"horizon": 200.0, "step_size": 100.0}, {"I2": None, "theta": None}
    large = {"I2": 9.0}, "sum of the other"
    for changes, word in (({"base": "spheroid"}, "base"), large, (long_step, "is not known"), (blank, "^I2 must")):
        with pytest.raises(SymtopError, match=word):
            answers.answer(answers.setup(fields("heavy-chaotic", "rk4", **changes)))
    with pytest.raises(SymtopError, match="the question lacks theta"):
        answers.setup({name: value for name, value in fields().items() if name != "theta"})
    with pytest.raises(SymtopError, match="map must be of a top"):
        answers.grid(fields("tennis-racket", "rk4"))
    with pytest.raises(SymtopError, match="must have the chart body"):
        answers.setup(fields("tennis-racket", "midpoint"))


def test_a_failing_run_is_an_answer_with_its_sentence():
    answer = answers.answer(answers.setup(fields(step_size=0.6)))
    assert (answer["outcome"], "theta left (0, pi)" in answer["message"]) == ("left_chart", True)
    assert np.isnan(unpack(answer["arrays"]["theta"])[-1])
    assert answer["steps"] < 5  # of 13 to the horizon
    assert answer["steps_per_nutation"] == pytest.approx(answer["period"] / 0.6, rel=0.05)
    assert answers.answer(answers.setup(fields()))["steps_per_nutation"] == pytest.approx(answer["period"] / 0.02)
    json.loads(json.dumps(answer, allow_nan=False))


@pytest.mark.parametrize(("changes", "word"), [
    ({"I3": 30.0}, "I3"), ({"I1": "heavy"}, "I1"), ({"theta": 4.0}, "theta"), ({"step_size": 0.0}, "step_size"),
    ({"step_size": None}, "step_size"), ({"step_size": 1e-9}, "2000000 steps"), ({"horizon": "nan"}, "horizon"),
    ({"integrator": "midpont"}, "midpoint"), ({"integrator": "rk4[axis]"}, "cannot show the attitude"),
    ({"integrator": "rk45", "tolerance": -1.0}, "tolerance"),
    ({"mgl": float("inf")}, "mgl"), ({"psi_dot": []}, "psi_dot"),
])  # fmt: skip
def test_bad_questions_are_refused_in_one_sentence(changes, word):
    with pytest.raises(SymtopError, match=word):
        answers.setup(fields(**changes))


def test_the_page_says_in_which_chart_a_method_runs_and_a_row_runs_in_its_own():
    listed = answers.catalogue()["integrators"]
    assert [entry["family"] for entry in listed].count("engine") == len(engines())
    chart_of = {entry["name"]: entry["chart"] for entry in listed}
    assert (chart_of["rk4"], chart_of["strang"]) == ("angles", "attitude")
    for name in ("rk4", "strang"):
        row = f"{name}[{chart_of[name]}]"
        runs = [answers.dataset(answers.setup(fields(integrator=variant)), lambda _: None) for variant in (name, row)]
        assert [run.attrs["chart"] for run in runs] == [chart_of[name]] * 2
        np.testing.assert_array_equal(runs[0]["theta"].values, runs[1]["theta"].values)


@pytest.mark.parametrize(("method", "scene", "changes"), [
    *((method, "goldstein", {"theta": 0.7123456789}) for method in ("trapezoidal", "rk45", "exact")),
    pytest.param("strang", "tennis-racket", {"w1": 0.0123456789, "horizon": 70.0}, marks=pytest.mark.quick),
])  # fmt: skip
def test_the_script_makes_the_same_dataset_to_the_bit(method, scene, changes, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    setup = answers.setup(fields(scene, method, **changes))
    with warnings.catch_warnings(action="ignore", category=SymtopWarning):  # the guard's, which the page has shown
        exec(compile(answers.script(setup), "explored.py", "exec"), {})
    assert netcdf.read(tmp_path / "explored.nc").equals(answers.dataset(setup, str))
    assert "reached t = 70" in capsys.readouterr().out


def request(site, method, path, body=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", site.server_address[1], timeout=60)
    try:
        connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
        response = connection.getresponse()
        return response.status, response.read(), dict(response.getheaders())
    finally:
        connection.close()


JSON = {"Content_Type": "application/json"}


def test_the_server_answers_this_machine_and_nothing_else(site):
    assert (request(site, "GET", "/")[0], request(site, "GET", "/", Host="evil.example")[0]) == (200, 403)
    assert request(site, "POST", "/run", "{}", Host="evil.example:80", **JSON)[0] == 403
    headers = {"Host": "127.0.0.1:80", "Origin": "http://127.0.0.1:80", "Sec_Fetch_Site": "same-origin"}
    for foreign in ({"Origin": "http://evil.example"}, {"Origin": "null"}, {"Sec_Fetch_Site": "cross-site"}):
        assert request(site, "POST", "/run", json.dumps(fields()), **headers | foreign, **JSON)[0] == 403
    assert request(site, "POST", "/run", json.dumps(fields()), **headers, **JSON)[0] == 200  # the control
    for path in ("/../cli.py", "/static/page.html", "/favicon.ico", "/run"):
        assert request(site, "GET", path)[0] == 404
    assert request(site, "POST", "/rum", "{}", **JSON)[0] == 404
    assert [request(site, method, "/")[:2] for method in ("HEAD", "PUT")] == [
        (200, b""), (405, b"PUT is not answered here; GET, HEAD and POST are\n")
    ]  # fmt: skip
    assert request(site, "POST", "/run", "a=1", Content_Type="application/x-www-form-urlencoded")[0] == 415
    assert request(site, "POST", "/run", " " * 70_000, **JSON)[0] == 413
    pairs = [request(site, "POST", path, text, **JSON)[:2] for path, text in {"/run": "{", "/oscillator": "3"}.items()]
    assert all(status == 200 and b"must be JSON" in body for status, body in pairs)
    status, body, _ = request(site, "POST", "/netcdf", json.dumps(fields(I3=30.0)), **JSON)
    assert (status, "I3 must be" in json.loads(body)["error"]) == (400, True)


@pytest.mark.parametrize(("method", "tolerance", "seconds"), [
    ("taylor-quad", 1e-30, 0.5), ("rk45", 1e-9, 0.5),
    *(pytest.param(*row, answers.MOST_SECONDS, marks=pytest.mark.slow)
      for row in (("taylor-quad", 1e-6), ("taylor-longdouble", 1e-12), ("radau", 1e-6))),
])  # fmt: skip
def test_a_run_to_its_budget_takes_its_seconds_within_a_factor_of_two(method, tolerance, seconds, monkeypatch):
    """Processor time of this thread: other processes do not count."""
    monkeypatch.setattr(answers, "MOST_SECONDS", seconds)
    monkeypatch.setattr(answers, "_budgets", {})
    setup = answers.setup(fields(integrator=method, tolerance=tolerance, horizon=1e6))
    before = time.thread_time()
    assert setup.budget <= answers.MOST_WORK[setup.method.implementation]
    after = time.thread_time()
    assert after - before < 2.0
    answer = answers.answer(setup)
    assert time.thread_time() - after < 2.0 * seconds
    assert (answer["outcome"], "limit on the work" in answer["message"]) == ("out_of_budget", True)
    second = answers.setup(fields(integrator=method, tolerance=tolerance, horizon=1e6))
    assert second.budget == setup.budget  # a script has the same
    assert f"budget={setup.budget!r}" in answers.script(second)


def test_a_cheap_method_has_the_whole_budget_and_a_hundred_thousand_steps_take_a_tenth_of_a_second():
    """Processor time of this thread, so that other processes do not count; each change is a new motion."""
    for method, horizon in (("rk45-compiled", 1e6), ("taylor-quad", 0.5)):
        answers._budgets.clear()
        setup = answers.setup(fields(integrator=method, tolerance=1e-9, horizon=horizon))
        assert setup.budget == answers.MOST_WORK["compiled"]
    assert answers.setup(fields()).budget is None
    assert answers.answer(setup)["outcome"] == "ok"
    answers.answer(answers.setup(fields(horizon=60.0, step_size=6e-4)))
    seconds = []
    for k in range(12):
        setup = answers.setup(fields(horizon=60.0, step_size=6e-4, theta=0.41 + 0.01 * k))
        before, answer = time.thread_time(), answers.answer(setup)
        seconds.append(time.thread_time() - before)
        assert answer["steps"] == 100_000
        if seconds[-1] < 0.1:
            return
    pytest.fail(f"the fastest of twelve answers took {min(seconds):.3f} s")


@pytest.mark.slow
def test_two_runs_that_never_end_do_not_keep_a_small_one_waiting(site):
    """Both places of a machine of two cores, by clients that leave."""
    question = json.dumps(fields(integrator="taylor-quad", tolerance=1e-30, horizon=1e6)).encode()
    head = f"POST /run HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: {len(question)}"
    for _ in range(2):
        with socket.create_connection(site.server_address) as browser:
            browser.sendall(f"{head}\r\n\r\n".encode() + question)
            time.sleep(0.3)  # it has begun
    start = time.monotonic()
    status, body, _ = request(site, "POST", "/run", json.dumps(fields()), **JSON)
    assert (status, json.loads(body)["outcome"]) == (200, "ok")
    assert time.monotonic() - start < 25.0  # 5 s on two free cores


def test_exports_over_http_and_a_bad_port_is_refused(site, tmp_path, monkeypatch):
    monkeypatch.setattr("symtop.methods.framework.registry.is_built_in", lambda _: False)
    question = fields(integrator="strang")
    status, body, _ = request(site, "POST", "/netcdf", json.dumps(question), **JSON)
    assert status == 200
    (tmp_path / "run.nc").write_bytes(body)
    assert netcdf.read(tmp_path / "run.nc").equals(answers.dataset(answers.setup(question), str))
    status, body, _ = request(site, "POST", "/script", json.dumps(question), **JSON)
    assert body.decode() == answers.script(answers.setup(question))
    for port in (site.server_address[1], 70_000):
        assert "port must be" in call("explore", "--port", port, code=2).output.split("-projected, vern9-projected")[1]


PLOT = "document.querySelector('#plot-{}').toDataURL()"
STATUS = "document.querySelector('#status').textContent"


def set_control(browser, selector, value):
    """Set a control of the page and wait for its answer."""
    count = browser.evaluate("+(document.body.dataset.answers || 0)")
    browser.set(selector, value)
    browser.wait_for(f"+document.body.dataset.answers > {count}")
    browser.wait_for(f"!{STATUS}.includes('computing')")


def test_a_person_can_use_it(explorer, tmp_path):
    browser = explorer()
    browser.wait_for("document.body.dataset.answers === '2'")  # the page asks twice as it opens
    browser.click("#play")
    browser.wait_for(f"{STATUS}.includes('midpoint: reached t = 8')")
    names = ("theta", "axis_error", "energy", "p_phi", "p_psi")
    before = {name: browser.evaluate(PLOT.format(name)) for name in names}
    assert len(set(before.values())) == len(names)
    set_control(browser, "#theta-slider", 0.9)  # a slider moves, the plots change
    assert browser.evaluate("document.querySelector('#theta').value") == "0.9"
    option = "document.querySelector('#scene').selectedOptions[0].text"
    assert browser.evaluate(option) == "spheroid (edited)"  # and so does the name
    assert all(browser.evaluate(PLOT.format(name)) != before[name] for name in names)
    scene = browser.evaluate("document.querySelector('#sphere').toDataURL()")
    browser.set("#clock", 0.5)
    browser.wait_for("document.querySelector('#now').textContent.startsWith('4.0')")
    browser.wait_for(f"document.querySelector('#sphere').toDataURL() !== {json.dumps(scene)}")
    scene = browser.evaluate("document.querySelector('#sphere').toDataURL()")
    browser.drag("#sphere", 80, 30)  # looked at from elsewhere
    browser.wait_for(f"document.querySelector('#sphere').toDataURL() !== {json.dumps(scene)}")
    browser.evaluate("HTMLAnchorElement.prototype.click = function () { window.saved = this.download; }")
    for button, file in (("#script", "explored.py"), ("#netcdf", "explored.nc")):
        browser.click(button)
        browser.wait_for(f"window.saved === {file!r}")
    set_control(browser, "#step_size", 0.6)  # a failing run shows its sentence
    browser.wait_for("document.body.dataset.answer === 'left_chart'")
    assert browser.evaluate("document.querySelector('#status').className") == "failed"
    browser.set("#I3", 30)  # and so does a top that cannot be, without the run before
    browser.wait_for("document.body.dataset.answer === 'refused'")
    assert browser.evaluate("document.querySelector('#netcdf').disabled")
    assert browser.evaluate("document.querySelector('#plots').innerText.trim()").startswith("The notebook's")
    browser.click("#reset")  # back to the scene as it is in the catalogue
    browser.wait_for("document.body.dataset.answer === 'ok'")
    assert browser.evaluate(option) == "spheroid"
    assert browser.evaluate("['I3', 'theta'].map((id) => document.getElementById(id).value)") == ["1", "0.4"]
    set_control(browser, "#scene", "goldstein")
    set_control(browser, "#integrator", "rk45")
    browser.wait_for(f"{STATUS}.startsWith('rk45: reached t = 70')")
    expression = "['step_size', 'tolerance'].map((name) => document.querySelector(`#${name}`).offsetParent === null)"
    assert browser.evaluate(expression) == [True, False]
    for width in (1280, 390):
        browser.resize(width, 900)
        assert browser.too_wide == 0
        assert browser.screenshot(tmp_path / "page.png", whole=width < 500).stat().st_size > 30_000
    assert browser.outside() == []


SLOWLY = """(() => {  // answers of the server arrive 0.3 s later
    const fetch = window.fetch, wait = () => new Promise((done) => setTimeout(done, 300));
    window.fetch = async (...all) => { const answer = await fetch(...all); await wait(); return answer; };
})()"""
LABELS = """(() => {  // texts on a canvas as it is drawn again
    const texts = [], context = document.querySelector("#plot-theta").getContext("2d");
    context.fillText = (text) => texts.push(text);
    window.dispatchEvent(new Event("resize"));
    delete context.fillText;
    return texts;
})()"""


@pytest.mark.slow
def test_an_answer_of_another_scene_or_method_than_the_pages_is_not_shown(explorer):
    browser = explorer("#base=tennis-racket&scene=tennis-racket&integrator=gauss-4&second=rk4")
    browser.wait_for(f"{STATUS}.startsWith('gauss-4: reached t = 100')")
    browser.evaluate(SLOWLY)
    browser.evaluate(f"window.said = []; setInterval(() => window.said.push({STATUS}), 5)")
    browser.set("#scene", "spheroid")
    browser.set("#second", "")  # before the answer is there
    browser.wait_for(f"{STATUS}.startsWith('gauss-4: reached t = 8')")
    assert not browser.evaluate("window.said.some((words) => words.includes('does not answer'))")
    clock = browser.evaluate("document.querySelector('#now').textContent")
    browser.wait_for(f"document.querySelector('#now').textContent !== {clock!r}", 5.0)  # the clock goes
    browser.set("#scene", "goldstein")
    browser.set("#horizon", 60)  # and no more: the answer before it is shown
    browser.wait_for("window.said.some((words) => words.startsWith('gauss-4: reached t = 70'))")


def test_the_page_counts_and_labels_what_can_be_told_apart(explorer):
    browser = explorer("#base=spheroid&scene=spheroid&integrator=strang&step_size=8")
    browser.wait_for(f"{STATUS}.includes('; 1 step, 0.15 a nutation, 1 force evaluation, ')")
    set_control(browser, "#step_size", 0.02)
    browser.wait_for(f"{STATUS}.includes('; 400 steps, 59 a nutation, 400 force evaluations, ')")
    for scene, words in (("spheroid", (True, "I1 (kg m²)")), ("steady-fast", (False, "I1"))):  # nodding, or hardly so
        set_control(browser, "#scene", scene)
        labels = browser.evaluate(LABELS)
        assert len(set(labels)) == len(labels) > 5, labels
        assert ("s" in labels, browser.evaluate("document.querySelector('[for=I1]').textContent")) == words


def test_a_warning_is_shown_on_the_page(explorer, monkeypatch):
    def worried(*args, guard=None, **controls):
        if guard is not None:
            guard("the phase will be <lost>")
        return integrate(*args, **controls)

    monkeypatch.setattr(answers, "integrate", worried)
    explorer().wait_for("document.querySelector('#warnings').textContent === 'the phase will be <lost>'")


def costs(**changes):
    """The chart of costs once all of its lines are there."""
    setups, end = cost.question(fields(**changes)), time.monotonic() + 120.0
    while (chart := cost.chart(setups))["missing"] and time.monotonic() < end:
        time.sleep(0.05)
    return chart


@pytest.mark.quick
def test_the_first_chart_of_costs_is_there_at_once_its_lines_those_of_compare_timed_together(monkeypatch):
    batches = []
    monkeypatch.setattr(cost, "_charts", {})
    monkeypatch.setattr(cost, "timed_rows", lambda cells: (batches.append(cells), timed_rows(cells)))
    setups = cost.question(fields(integrator="trapezoidal", second="strang", horizon=7.5))
    start, first = time.thread_time(), cost.chart(setups)
    assert time.thread_time() - start < 1.0
    assert first["missing"] > 0
    chart = costs(integrator="trapezoidal", second="strang", horizon=7.5)
    lines = {line["name"]: line for line in chart["lines"]}
    assert {"trapezoidal", "strang", *cost.PEERS} == {*lines}
    data = symtop.compare(setups[0].scene, ["trapezoidal[angles]"], budget=3e5, quiet=True).isel(variant=0)
    errors = data["error"].values[np.isfinite(data["seconds"].values)]
    assert (lines["trapezoidal"]["error"], chart["missing"]) == (errors.tolist(), 0)
    assert max(lines["trapezoidal"]["error"]) / min(lines["trapezoidal"]["error"]) > 1e4
    assert np.argmin(lines["trapezoidal"]["error"]) in np.argsort(lines["trapezoidal"]["seconds"])[-2:]
    repeat = costs(integrator="trapezoidal", second="strang", horizon=7.5)
    assert repeat["lines"] == chart["lines"]  # stored; the runs of the page are timed again
    # Timed one by one, a slow moment of the machine would be a slow method.
    (cells,) = [cells for cells in batches if cells[0][0] == setups[0].scene]  # charts of other tests may end late
    assert [variant.method for _, variant, _, _ in cells] == [*lines]
    assert all(len(line["seconds"]) > 3 for line in lines.values())


@pytest.mark.slow
def test_the_chart_of_a_body_has_the_methods_that_step_it():
    lines = {line["name"]: line for line in costs(name="tennis-racket", integrator="gauss-2", second="strang")["lines"]}
    assert {*lines} == {"gauss-2", "strang", "rk4", "gauss-4", "dop853-compiled"}
    assert all(min(line["error"]) < 1e-3 and not line["message"] for line in lines.values())


@pytest.mark.quick
def test_the_run_of_the_page_is_a_point_on_the_line_of_its_method():
    """The least of some times, as others work beside; a run that fails has no time."""
    line = next(line for line in costs(integrator="strang")["lines"] if line["name"] == "strang")
    (setup,) = setups = cost.question(fields(integrator="strang", step_size=0.02))
    error = answers.answer(setup)["largest"]["axis_error"]
    seconds = min(cost.chart(setups)["seconds"][0] for _ in range(8))
    assert 1 / 3 < seconds / np.exp(np.interp(-np.log(error), -np.log(line["error"]), np.log(line["seconds"]))) < 3.0
    assert costs(step_size=0.6)["seconds"] == [None]
    with pytest.raises(SymtopError, match="midpoint"):
        cost.question(fields(second="midpont"))


def test_a_line_that_cannot_be_measured_says_why(monkeypatch):
    monkeypatch.setattr(cost, "_charts", {})
    monkeypatch.setattr(cost, "compare", Mock(side_effect=SymtopError("the scene is <odd>")))
    assert {line["message"] for line in costs(theta=0.41)["lines"]} == {"the scene is <odd>"}


def test_a_run_is_answered_while_lines_are_measured(site, monkeypatch):
    event = threading.Event()

    def slow_compare(*args, **options):
        event.wait(60.0)
        raise SymtopError("late")

    monkeypatch.setattr(cost, "_charts", {})
    monkeypatch.setattr(cost, "compare", slow_compare)
    start = time.monotonic()
    for step in (0.02, 0.03, 0.04):
        chart = json.loads(request(site, "POST", "/cost", json.dumps(fields(theta=0.42, step_size=step)), **JSON)[1])
        assert chart["missing"] == len(cost.PEERS) + 1
        assert chart["seconds"][0] > 0.0
    assert json.loads(request(site, "POST", "/run", json.dumps(fields()), **JSON)[1])["outcome"] == "ok"
    assert time.monotonic() - start < 20.0
    event.set()


def test_the_oscillator_of_the_page_is_the_notebooks():
    """Order two with either rule."""
    coarse, fine = (answers.oscillator(0.1, step)["largest"] for step in (0.1, 0.05))
    assert [coarse[rule] / fine[rule] for rule in answers.RULES] == pytest.approx([4.0] * 2, rel=0.05)
    arrays = {name: unpack(text) for name, text in answers.oscillator(0.3, 0.5)["arrays"].items()}
    decay, turn = np.exp(-0.15 * arrays["exact_time"]), np.sqrt(1.0 - 0.15**2) * arrays["exact_time"]
    exact = decay * (np.cos(turn) + 0.15 / np.sqrt(1.0 - 0.15**2) * np.sin(turn))
    np.testing.assert_allclose(arrays["exact"], exact, atol=1e-6)
    assert np.abs(arrays["midpoint"][-10:]).max() < 0.1 < np.abs(arrays["guess"][-10:]).max()  # it damps nothing
    for changes, word in (({"friction": -0.1}, "friction must be at least 0"), ({"friction": 1e160}, "at most 1e"),
                          ({"oscillator_step": 20.0}, "step must")):  # fmt: skip
        with pytest.raises(SymtopError, match=word):
            answers.damped({"friction": 0.1, "oscillator_step": 0.5} | changes)


def damped_run(friction, name="spheroid", **changes):
    """The page's damped top: the answer with its arrays."""
    answer = answers.inclination(*answers.damped_top(fields(name, friction=friction, **changes)))
    return answer, {name: unpack(text) for name, text in answer["arrays"].items()}


@pytest.mark.quick
def test_the_damped_top_of_the_page_is_the_studys():
    """Order two; the exact motion is the study's; it ends where the bearings meet."""
    coarse, fine = (damped_run(0.1, step_size=step, horizon=3.0)[0]["largest"]["midpoint"] for step in (0.01, 0.005))
    assert coarse / fine == pytest.approx(4.0, rel=0.05)
    answer, arrays = damped_run(0.1)
    scene, times = symtop.scene("spheroid"), np.linspace(0.0, 8.0, 9)
    indices = np.searchsorted(arrays["exact_time"], times.astype(np.float32))
    truth = np.degrees(damped_truth(scene, Friction(0.05, 0.1), times)[0][0])
    np.testing.assert_allclose(arrays["exact"][indices], truth, atol=1e-4)
    undamped = np.degrees(closed_form(scene)(times).theta)
    np.testing.assert_allclose(damped_run(0.0)[1]["exact"][indices], undamped, atol=1e-4)
    assert np.abs(truth - undamped).max() > 1.0  # friction does something
    assert answer["message"] == ""
    answer, arrays = damped_run(1.0)
    # of steps of 0.02 s the last inside the chart, and the pole
    assert re.match(r"midpoint: left chart at t = 3.66; .* of a pole at t = 3.68 and", answer["message"])
    assert arrays["exact"][-1] == pytest.approx(np.degrees(np.pi - 0.01), abs=1.0)
    assert arrays["exact_time"][-1] < 3.68
    for changes, word in (
        ({"friction": -0.1}, "friction must be at least 0"), ({"friction": 1e160}, "friction must be at most 1e"),
        ({"step_size": 1e-5}, "at most 100000 steps"),
        ({"name": "sleeping", "step_size": 0.1}, "more than 50000 evaluations"), ({"theta": 0.0}, "must lie inside"),
    ):  # fmt: skip
        with pytest.raises(SymtopError, match=word):
            damped_run(**{"friction": 0.1} | changes)


@pytest.mark.slow
def test_the_chart_of_costs_and_the_oscillator_are_on_the_page(explorer):
    browser = explorer()
    chart = "document.querySelector('#cost').dataset"
    browser.wait_for(f"{chart}.missing === '0' && {chart}.points === '1'")
    set_control(browser, "#second", "strang")
    browser.wait_for(f"{chart}.points === '2'")
    image = browser.evaluate("document.querySelector('#cost').toDataURL()")
    lines = browser.evaluate(f"{chart}.lines")
    set_control(browser, "#step_size", 0.05)  # the points move along their lines
    assert browser.evaluate(f"{chart}.lines") == lines != "0"
    change = f"document.querySelector('#cost').toDataURL() !== {json.dumps(image)}"
    browser.wait_for(f"{chart}.points === '2' && {change}")
    set_control(browser, "#step_size", 0.6)  # midpoint fails, strang does not
    browser.wait_for(f"{chart}.points === '1'")
    maps, names = browser.evaluate("document.body.dataset.maps"), ("oscillator", "damped-top")
    answer_count = "+document.querySelector('#{}-key').dataset.answers".format
    before = {name: (browser.evaluate(answer_count(name)), browser.evaluate(PLOT.format(name))) for name in names}
    browser.set("#friction-slider", 1.5)
    for name, (count, image) in before.items():
        browser.wait_for(f"{answer_count(name)} > {count}")
        assert browser.evaluate(PLOT.format(name)) != image
    browser.wait_for("document.querySelector('#damped-top-key').textContent.includes('rad of a pole')")
    assert "friction=1.5" in browser.evaluate("location.hash")
    assert browser.evaluate("document.body.dataset.maps") == maps  # the top has not changed
    browser.set("#friction", -1)
    for name in names:
        browser.wait_for(f"document.querySelector('#{name}-key').textContent.includes('at least 0')")
    browser.evaluate("window.went = fetch; window.never = new Promise(() => {}); 0")
    browser.evaluate("window.fetch = (path, ...rest) => (path === 'cost' ? never : went(path, ...rest)); 0")
    set_control(browser, "#theta", 0.5)
    browser.wait_for(f"{chart}.lines === '0'")  # lines of another motion are not shown
