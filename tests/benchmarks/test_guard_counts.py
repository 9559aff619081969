"""The command that the page on choosing names says what came of its runs."""

import sys

import pytest

from benchmarks import guard as counted

RUN = dict.fromkeys(counted.Run.__annotations__, 0) | {"outcome": "ok"}
RUNS = [
    counted.Run(**(RUN | {"error": error, "exact": expected, "series": 0.0}))  # type: ignore[arg-type]
    for error, expected in ((1.0, 1.0), (0.02, 0.001), (1e-4, 1.0), (1e-6, 0.0))
]


def test_runs_that_were_made_are_counted_in_a_sentence_for_each_guard(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(counted, "make", lambda *_: None)
    monkeypatch.setattr(counted, "kept", lambda _: RUNS)
    monkeypatch.setattr(sys, "argv", ["guard", "tops", "4"])
    counted.main()
    exact, series = [line for line in capsys.readouterr().out.splitlines() if line.startswith("4 runs")]
    assert "guard 'exact': of 2 wrong ones 1 were silent, the worst off by 0.02 rad; of 2 right ones 1 were" in exact
    assert "guard 'series': of 2 wrong ones 2 were silent, the worst off by 1 rad; of 2 right ones 0 were" in series
