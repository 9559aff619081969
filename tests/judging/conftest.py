"""A battery of a few claims, for tests that look at one: a whole judging takes ten times as long."""

import pytest

from symtop.judging import battery


@pytest.fixture
def only(monkeypatch):
    """A function that leaves the claims of these names in the table of the battery."""

    def choose(*names):
        chosen = tuple(claim for claim in battery.TABLE if claim.name in names)
        assert len(chosen) == len(names)
        monkeypatch.setattr(battery, "TABLE", chosen)

    return choose
