"""The command line: what it prints and its exit codes, that it starts fast, and `doctor`, which finds each fault."""

import importlib.metadata
import importlib.util
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import click.testing
import pytest

import symtop
from symtop.cli import doctor, runs
from symtop.cli.main import main
from symtop.core import netcdf, parallel
from symtop.core.files import cache_root
from symtop.measure import published, timing
from symtop.methods.framework.loop import inside
from symtop.methods.framework.registry import bibliography, citation_keys, engines, methods
from symtop.run.ensemble import population
from tests.commands import call

OWN, BODY = "one of your own: --plugin FILE)", "one of your own: body with --body I1,I2,I3 or --plugin FILE)"


@pytest.mark.parametrize(("words", "parts"), [
    ("run sferoid midpoint --step-size 0.1", ["scene 'sferoid'", "spheroid", "symtop scenes", BODY]),
    ("run spheroid midpont --step-size 0.1", ["integrator 'midpont'", "midpoint", "symtop integrators", OWN]),
    ("run midpoint spheroid", ["scene 'midpoint'", "an integrator", "scene comes first"]),
    ("run spheroid midpoint[attitude] --step-size 0.1", ["chart of midpoint 'attitude'", "angles"]),
    ("run spheroid midpoint", ["needs --step-size", "0.007"]), ("run spheroid rk45", ["needs a tolerance", "1e-6"]),
    ("run spheroid taylor --figure no-such/x.png", ["--figure", "folder that is there", "no-such/x.png"]),
    ("run spheroid taylor --output run.csv", ["--output is written as netCDF", "run.nc", "'run.csv'"]),
    ("run spheroid rk4 --step-size 0.1 --output a.png --figure ./a.png", ["--output and --figure", "two files"]),
    ("run spheroid strang --step-size 0.01 --output ..", ["--output must be a file, not the folder '..'"]),
    ("run spheroid strang --step-size 0.01 --figure ../x.png", ["--figure must be a file, not the folder"]),
    ("long spheroid strang -o ..", ["file, not the folder"]), ("run spheroid rk4 -o \udcff.nc", ["'\\udcff"]),
    ("ensemble strang --members 1000000 --figure ../x.png", ["--figure must be a file, not the folder"]),
    ("recommend cusp --accuracy 1 --step-size 1 --per-nutation 9", ["p-size", "not both"]), ("archive -o .", ["t '.'"]),
    ("study convergense", ["'convergense'", "convergence"]), ("study", ["name a study", "--all", "convergence"]),
    ("archive --output ../x.py", ["in .zip"]), ("archive --test-set --output no/x", ["that is there, not 'no/x'"]),
    ("run spheroid", ["missing argument 'INTEGRATOR'", "run [OPTIONS] SCENE INTEGRATOR"]),
    ("run spheroid rk4 more", ["argument (more)", "run [OPTIONS] SCENE INTEGRATOR"]), ("cite rk4", ["'rk4', which d"]),
    ("run spheroid rk4 --step-size abc", ["--step-size must be a number, not 'abc'"]), ("--nope", ["option '--nope'"]),
    ("judge x.py:step --order two", ["--order must be a whole number, not 'two'"]),
    ("recommend spheroid", ["--accuracy", "--i-use"]), ("study convergence --status --check", ["--status and --check"]),
    ("report --results /etc/hostname", ["a folder, not '/etc/hostname', which"]), ("study --scene x", ["; did you"]),
])  # fmt: skip
def test_a_refusal_names_the_argument_its_value_and_what_is_allowed(words, parts, tmp_path, monkeypatch):
    (tmp_path / "x.png").mkdir()
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    result = call(*words.split(), code=2)
    (line,) = [line for line in result.stderr.splitlines() if not line.startswith("symtop: study, ")]
    assert all(part in line for part in parts), line
    assert ("the scene comes first" in line) is ("scene comes first" in parts)
    assert list(Path().iterdir()) == []
    assert click.UsageError.show.__module__ == "click.exceptions"  # that of other programs of this process


def test_a_plugin_that_registers_nothing_is_told_of(tmp_path):
    replaced = "import dataclasses, symtop\nown = symtop.integrators()['midpoint']\n"
    replaced += "symtop.register(dataclasses.replace(own, summary='mine'), replace=True)\n"
    for text, expected in (("x = 1\n", True), (replaced, False)):
        plugin = tmp_path / f"plugin_{len(text)}.py"
        plugin.write_text(text, encoding="utf-8")
        result = call("scenes", "--plugin", plugin)
        assert (f"{plugin.name} registers no integrator and no scene" in result.output) is expected


@pytest.mark.parametrize(("words", "called"), [
    (["run", "spheroid", "strang", "--step-size", "0.01"], "symtop.run.simulation.simulate"),
    (["recommend", "spheroid", "--accuracy", "1e-3"], "symtop.advise.recommend"),
    (["claims", "strang", "--quick"], "symtop.judging.judge_step.judge_separately"),
])  # fmt: skip
def test_ctrl_c_is_neither_a_failed_case_nor_bad_input(words, called, monkeypatch):
    interrupts = lambda *_, **__: os.kill(os.getpid(), signal.SIGINT)
    raises = Mock(side_effect=symtop.SymtopError("of its own"))
    for function, code, message in ((interrupts, 130, "interrupted"), (raises, 2, "of its own")):
        monkeypatch.setattr(called, function)
        assert call(*words, code=code).output.splitlines()[-1] == f"symtop: {message}"


def numbers(text):
    """JSON as others read it: NaN and Infinity are no numbers."""
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def test_run_prints_the_errors_and_writes_the_dataset_also_of_a_run_that_fails_or_has_nan(tmp_path):
    words = ("run", "spheroid", "midpoint", "--step-size", 0.01, "-o", path := tmp_path / "run.nc")
    assert "angle between axes" in call(*words).output
    assert netcdf.read(path).attrs["integrator"] == "midpoint"
    report = numbers(call(*words, "--json").stdout)
    assert report["steps"] == 800
    assert 1e-3 < report["errors"]["axis"]["largest"] < 2e-2
    assert report["errors"]["p_psi"]["largest"] < 1e-14
    assert "\n1 step, 1 force evaluation\n" in call("run", "spheroid", "strang", "--step-size", 8, "--no-guard").output
    call("run", "spheroid", "stormer-verlet", "--step-size", 1.0, "--horizon", 50, "--output", path, code=3)
    assert netcdf.read(path).attrs["outcome"] == "left_chart"
    with pytest.raises(pytest.fail.Exception):
        numbers("[NaN]")
    advice = numbers(call("recommend", "spheroid", "--accuracy", "1e-17", "--json", code=1).stdout)
    assert (advice["seconds"], advice["accuracy"]) == (None, 1e-17)
    plugin = tmp_path / "endless.py"  # a top whose nutation never ends
    start = "symtop.scene('spheroid').top, symtop.Angles(0.0, psi_dot=0.1), 1.0, reference='notes, woodhouse-2009'"
    plugin.write_text(f"import symtop\nsymtop.register_scene(symtop.Scene('endless', {start}))\n")
    assert numbers(call("scenes", "--json", "--plugin", plugin).stdout)
    assert "\n\n@book{woodhouse-2009," in call("scenes", "endless", "--plugin", plugin).stdout


def test_help_starts_fast():
    """At most three times the processor time that importing click takes."""

    def spent(*command):
        subprocess.run(command, check=True, capture_output=True)
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime

    best = lambda *command: min(b - a for a, b in pairwise([spent(*command) for _ in range(4)]))
    assert best(sys.executable, "-m", "symtop.cli", "--help") < 3.0 * best(sys.executable, "-c", "import click") + 0.05


def test_a_variant_runs_in_its_own_chart_and_the_help_says_how_to_name_it(tmp_path):
    changes = {}
    for chart in ("angles", "axis"):
        path = tmp_path / f"{chart}.nc"
        result = call("run", "spheroid", f"rk4[{chart}]", "--step-size", 0.02, "--output", path, "--json")
        assert netcdf.read(path).attrs["chart"] == chart
        changes[chart] = json.loads(result.output)["errors"]["p_phi"]["largest"]
    assert changes["axis"] == 0.0 < changes["angles"]
    words = ["run", "spheroid", "rk4", "--step-size", "0.1", "--horizon", "1", "--no-guard"]
    assert call(*words).output.startswith("rk4[angles] on spheroid: reached")
    assert "rk4[axis]" in call("run", "--help").output
    assert "NAME[CHART]" in call("integrators").output
    assert "nothing common to all charts of rk4" in call("integrators", "rk4[axis]").output  # it keeps p_phi there


@pytest.mark.parametrize(("line", "completion"), [
    ("symtop run sph", "spheroid"), ("symtop run tennis", "tennis-racket"), ("symtop study cl", "claims"),
    ("symtop run spheroid midp", "midpoint"), ("symtop run spheroid rk4[", "rk4[axis]"),
    ("symtop integrators strang[att", "strang[attitude]"),
])  # fmt: skip
def test_the_shell_completes_names(line, completion):
    environment = {"_SYMTOP_COMPLETE": "bash_complete", "COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    assert f"plain,{completion}" in click.testing.CliRunner().invoke(main, prog_name="symtop", env=environment).output


ENDING = """
import atexit, os, sys, threading, time
import symtop.cli.__main__ as command, symtop.cli.main

class Heavy:
    def __del__(self, write=os.write):
        write(1, b"taken apart\\n")

def work():
    time.sleep(0.5)
    print("the thread is done")

def main(**_):
    print("the answer")
    {before}
    sys.exit({code})

command.kept, sys.modules["symtop.cli.main"].main = Heavy(), main
atexit.register(print, "what was registered")
command.run()
"""
EARLY = """import signal, sys; from types import SimpleNamespace as Hook
sys.meta_path.insert(0, Hook(find_spec=lambda name, *_: signal.raise_signal(2) if name == "symtop.cli.main" else None))
from symtop.cli.__main__ import run; run()"""


def ending(before="", code="3"):
    words = [sys.executable, "-c", ENDING.format(before=before, code=code)]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize(("line", "code", "message"), [
    ("symtop scenes 1>&-", 0, ""), ("symtop run nowhere 0<&- 1>&- 2>&-", 2, ""), ("symtop integrators | true", 141, ""),
    ("symtop integrators | cat", 0, ""), ("symtop run nowhere | true", 2, ""),
    pytest.param("symtop scenes > /dev/full", 2, "symtop: cannot write what there is to say: No space left on device\n",
                 marks=pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")),
    ("mkdir gone; cd gone; rmdir ../gone; symtop run spheroid exact -o run.nc", 2, ".*no longer there.*\n"),
])  # fmt: skip
def test_a_stream_or_a_folder_that_is_gone_or_a_full_disk_is_no_case_that_has_failed(line, code, message, tmp_path):
    """Python has None in the place of a stream that was closed; a refusal (the control) is one all the same."""
    shell = ["/bin/bash", "-o", "pipefail"] if "|" in line else ["/bin/sh"]
    if not Path(shell[0]).exists():
        pytest.skip(f"there is no {shell[0]}")
    command = [*shell, "-c", line.replace("symtop", f"{sys.executable} -m symtop.cli")]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode == code, result.stderr
    assert "Traceback" not in result.stderr
    assert not message or re.fullmatch(message, result.stderr), result.stderr


def test_a_command_ends_with_its_code_takes_nothing_apart_and_waits_for_threads():
    result = ending()
    assert (result.returncode, result.stdout, result.stderr) == (3, "the answer\nwhat was registered\n", "")
    assert ending(code="None").returncode == 0
    result = ending(before="threading.Thread(target=work).start()")
    assert result.stdout.splitlines() == ["the answer", "the thread is done", "what was registered", "taken apart"]
    assert result.returncode == 3
    result = ending(before="threading.Timer(0.3, os.kill, (os.getpid(), 2)).start()")  # Ctrl-C, while it waits
    assert (result.returncode, result.stderr) == (-signal.SIGINT, "")
    result = subprocess.run([sys.executable, "-c", EARLY], capture_output=True, text=True, timeout=60, check=False)
    assert (result.returncode, result.stderr) == (-signal.SIGINT, "")  # while modules are imported
    result = ending(code="'a text'")
    assert (result.returncode, result.stderr) == (1, "a text\n")


@pytest.mark.parametrize("words", [("-m", "symtop"), ("-m", "symtop.cli")])
def test_however_it_is_called_linear_algebra_has_one_thread(words, tmp_path):
    """Threads of BLAS wait for each other on busy cores: a fit of 10 ms took 0.7 s."""
    (tmp_path / "sitecustomize.py").write_text(
        "import atexit, os\natexit.register(lambda: print('threads', os.environ.get('OPENBLAS_NUM_THREADS')))\n"
    )
    clean = {name: value for name, value in os.environ.items() if name not in parallel.VARIABLES}
    command, path = [sys.executable, *words, "scenes"], os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    result = subprocess.run(command, capture_output=True, text=True, env=clean | {"PYTHONPATH": path}, check=True)
    assert result.stdout.endswith("threads 1\n")


@pytest.mark.parametrize(("command", "entries"), [
    (["integrators"], methods), (["integrators", "--engines"], engines), (["scenes"], symtop.scenes)])  # fmt: skip
def test_a_list_fits_the_terminal_and_names_every_entry(command, entries, monkeypatch):
    for columns in (80, 120):
        lines = call(*command, COLUMNS=str(columns)).output.splitlines()
        assert max(map(len, lines)) <= columns
        assert (names := {line.split(" ")[0] for line in lines}) >= set(entries())
        assert ("mujoco-euler" in names, "strang" in names) == (entries is engines, entries is methods)
    monkeypatch.delenv("COLUMNS", raising=False)
    piped = call(*command).output.splitlines()  # a line each, for grep
    assert {line.split(" ")[0] for line in piped[2 : 2 + len(entries())]} == set(entries())
    assert max(map(len, call(*command, "--wide", COLUMNS="80").output.splitlines())) > 80


@pytest.mark.parametrize(("scene", "name"), [("spheroid", "strang"), ("goldstein", "gauss-4"), ("simo-wong", "rk4")])
def test_a_run_cites_the_sources_of_its_method_and_of_its_scene(tmp_path, scene, name):
    data = symtop.simulate(scene, name, step_size=0.01, horizon=0.1)
    text = call("cite", file := netcdf.write(data, tmp_path / "run.nc"), file).stdout
    keys = citation_keys(symtop.integrator(name)), citation_keys(symtop.scene(scene))
    sources = {*keys[0], *keys[1]}
    assert (len(keys[0]) > 0, len(keys[1])) == (True, int(scene != "spheroid"))
    assert all(bibliography()[key] in text for key in sources)
    assert all((bibliography()[key] in call("scenes", scene).stdout) for key in keys[1])
    assert text.count("\n@") == len(sources)  # once each


def test_without_a_file_the_package_is_cited_and_a_method_without_a_known_source_is_said(tmp_path):
    text = call("cite").stdout
    assert (re.findall(r"@(\w+)\{", text), f"version = {{{symtop.__version__}}}" in text) == (["software"], True)
    data = symtop.simulate("spheroid", "strang", step_size=0.01, horizon=0.1).assign_attrs(integrator="of-a-user")
    result = call("cite", netcdf.write(data, tmp_path / "run.nc"))
    assert ("no source is known of of-a-user" in result.stderr, result.stdout.count("@")) == (True, 1)


SLOW = """\
import sys, time
from symtop.core import progress
progress.FIRST_LINE, progress.NEXT_LINE = 0.1, 0.15
with progress.showing_work("judge"):
    time.sleep(float(sys.argv[1]))
    with progress.showing_seconds("trying methods"):
        time.sleep(float(sys.argv[1]))
"""


def stderr_of(code, *words):
    return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True).stderr


def test_a_command_that_waits_says_what_it_does_and_one_that_is_quick_nothing():
    lines = stderr_of(SLOW, "0.5").splitlines()
    assert [line.split(",")[0] for line in (lines[0], lines[-1])] == ["symtop: judge", "symtop: trying methods"]
    assert 3 <= len(lines) <= 8
    assert all(line.endswith(" s") for line in lines)
    assert stderr_of(SLOW, "0.01") == ""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_the_lines_end_with_a_command_that_is_killed():
    code = SLOW.replace("with progress", "print('on', flush=True)\nwith progress", 1)
    process = subprocess.Popen([sys.executable, "-c", code, "60"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.readline()
    time.sleep(0.5)
    process.kill()
    assert process.communicate(timeout=10)[1].count(b"symtop: judge") < 20  # the pipe is closed by all who wrote to it


def test_a_run_of_many_steps_says_how_long_it_takes(capsys, monkeypatch):
    """Steps of a microsecond: a million are not timed, five million take five seconds, a billion a quarter hour."""
    counts, now, step = [], [0.0], 1e-6
    monkeypatch.setattr(timing, "time", SimpleNamespace(perf_counter=lambda: now[0]))

    def run(steps):
        counts.append(steps)
        now[0] += 0.3 + step * steps  # whatever the steps, as the set-up of a long run does

    runs.estimate(1e6, run)
    assert not counts
    runs.estimate(5e6, run)
    assert capsys.readouterr().err == ""
    runs.estimate(1e9, run)
    assert 15 <= int(re.fullmatch(r"symtop: 1e\+09 steps take about (\d+) min\n", capsys.readouterr().err)[1]) <= 25
    runs.estimate(9e9, run)  # and so many two and a half hours
    assert re.fullmatch(r"symtop: 9e\+09 steps take about 2.\d h\n", capsys.readouterr().err)
    assert max(counts) < 1.1e6
    counts.clear()
    step = 1e-4  # in plain Python
    runs.estimate(3e6, run)
    assert "take about 5" in capsys.readouterr().err
    assert sum(counts) < 40_000


def test_members_that_do_not_fit_into_memory_are_refused_before_they_are_drawn(monkeypatch):
    monkeypatch.setattr(population, "memory", lambda: 1000.0 * population.BYTES)
    assert population.population(1000).sizes["member"] == 1000
    with pytest.raises(symtop.SymtopError, match=r"n must be at most 1e\+03 in the .* GiB of this machine.*, not 1001"):
        population.population(1001)
    result = call("ensemble", "strang", "--members", "1001", "--per-nutation", "20", "--nutations", "1", code=2)
    assert "--members must be at most" in result.stderr


def faults(findings):
    return {finding.topic: finding for finding in findings if not finding.healthy}


@pytest.mark.parametrize(("requirement", "result", "healthy"), [
    ("numpy[some-extra]>=2.0", "2.4.6", True), ("numpy[some-extra]>=3.0", "2.4.6", False),
    ("numpy~=2.0", "2.4.6", True), ("numpy~=1.26", "2.4.6", False), ("numpy>=2,!=2.4.6", "2.4.6", False),
    ("no-such-package", "absent", False), ("no-such-package; extra == 'peers'", "absent, an extra", True),
    ("numpy<2; extra == 'peers'", "2.4.6", False), ("no-such-package; sys_platform == 'amiga'", None, True),
    ("no-such-package; extra == 'peers' and sys_platform == 'amiga'", None, True),
    ("no-such-package; python_version >= '3.8'", "absent", False),
])  # fmt: skip
def test_every_form_of_a_requirement_is_read(monkeypatch, requirement, result, healthy):
    real = importlib.metadata.version
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: [requirement])
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "2.4.6" if name == "numpy" else real(name))
    findings = doctor._packages(Path())
    assert [(finding.result, finding.healthy) for finding in findings] == ([(result, healthy)] if result else [])
    assert all(finding.healthy or finding.advice for finding in findings)


def test_a_cache_that_cannot_be_written_and_a_wrong_number_are_seen(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path / "file" / "cache"))
    assert "SYMTOP_CACHE" in faults(doctor._caches(Path()))["cache"].advice
    assert set(faults(doctor._results(Path("/proc/none")))) == {"results"}
    value = published.KnownValue("somebody", "something", 1.0, 1.1, 1e-3, "printed")
    monkeypatch.setattr(published, "published_values", lambda: [value])
    findings = faults(doctor._self_check(Path()))
    assert "not somebody, something" in findings["published values"].result
    assert set(findings) == {"published values"}
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)  # its requirement says where heyoka must be
    assert not faults(doctor._heyoka(Path()))


def test_a_check_that_fails_is_a_finding_and_the_code_is_1(monkeypatch, tmp_path):
    monkeypatch.setitem(doctor.CHECKS, "machine", Mock(side_effect=OSError("the tools are gone")))
    monkeypatch.setitem(doctor.CHECKS, "self-check", lambda _: [])
    result = call("doctor", "--results", tmp_path, code=1)
    assert "BAD  machine" in result.output
    assert "OSError: the tools are gone" in result.output


def test_all_is_well_here_and_every_compiled_method_is_run_in_each_of_its_charts(tmp_path):
    result = call("doctor", "--results", tmp_path, "--json")
    topics = {entry["topic"]: entry["result"] for entry in json.loads(result.output)}
    expected = {"python", "numba", "cache", "kernels cache", "reference cache", "studies", "published values"}
    assert expected <= set(topics)
    assert (topics["heyoka quad"], topics["numba"]) == ("33.7 digits", importlib.metadata.version("numba"))
    count = len(published.published_values())
    assert topics["published values"] == f"{count} of {count} reproduced"
    names = doctor.variants()
    assert len(names) == len(set(names))
    for method in symtop.integrators().values():
        variants = {f"{method.name}[{chart}]" for chart in method.solvers}
        assert variants <= set(names) if method.implementation != "python" else not variants & set(names)
    assert [doctor._run(name) for name in ("rk4[body]", "gauss-4[axis]", "midpoint[angles]")] == [""] * 3


@pytest.mark.slow
def test_all_of_them_are_compiled_once(monkeypatch, tmp_path):
    """From the kernels that other tests have left, less an eighth: all of them take six minutes."""
    (cache_root() / "kernels").mkdir(parents=True, exist_ok=True)
    shutil.copytree(cache_root() / "kernels", tmp_path / "kernels")
    for folder in sorted((tmp_path / "kernels").iterdir())[::8]:
        shutil.rmtree(folder)
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    result = call("doctor", "--warm", "--results", tmp_path / "r")
    assert doctor.kernels() > 100
    assert "not run" not in result.output
    assert "kernels compiled: 0;" in call("doctor", "--warm", "--results", tmp_path / "r").output
    solvers = [inside(solver) for method in symtop.integrators().values() for solver in method.solvers.values()]
    blocks = [solver._whole.blocks() for solver in solvers if solver and solver.in_lanes]
    folders = {kernel._cache.cache_path.name for block in blocks for kernel in (block.prepare, block.march)}
    assert len(folders) > 50
    assert all(any((tmp_path / "kernels" / folder).glob("*.code")) for folder in folders)
