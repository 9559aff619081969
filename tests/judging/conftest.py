"""A battery of a few claims, for tests that look at one: a whole judging takes ten times as long. One seed for all."""

import pytest

from symtop.judging import battery, judge_step
from symtop.judging.claims import calls, order, structure, subject


@pytest.fixture(autouse=True)
def one_seed(monkeypatch):
    """What a judging draws is the same each time; other seeds are tried where a test names them."""
    monkeypatch.setattr(judge_step.secrets, "randbelow", lambda n: 20_261_123 % n)


def shorten(monkeypatch):
    """A quick judging takes an eighth of the time: shorter runs, fewer starts that are drawn."""
    for module, name, numbers in (
        (subject, "LONG_SECONDS", (10.0, 0.5)), (subject, "SLOPE_SECONDS", (6.0, 0.2)), (order, "DRAWS", (96, 4)),
        (subject, "TIMED_SECONDS", 0.005), (calls, "LATE_RUNS", calls.LATE_RUNS | {True: (20_000, 0.15)}),
        (structure, "DRAWS", (8, 1)),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, numbers)


@pytest.fixture
def keep_claims(monkeypatch):
    """A function that leaves the claims of these names in the table of the battery, with an eighth of the time."""

    def choose(*names):
        stages = [row._replace(claims=tuple(claim for claim in row.claims if claim in names)) for row in battery.TABLE]
        assert {claim for stage in stages for claim in stage.claims} == {*names}
        monkeypatch.setattr(battery, "TABLE", tuple(stage for stage in stages if stage.claims))
        shorten(monkeypatch)

    return choose
