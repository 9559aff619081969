"""The stored report has no finding and no caption that nobody reads to its end."""

import itertools
from pathlib import Path

import pytest

REPORT = Path(__file__).resolve().parents[2] / "docs" / "snapshot" / "report.md"
MOST_OF_FINDING = 400  # characters
MOST_OF_CAPTION = 700
OPEN, CLOSE = "<details>", "</details>"  # of a folded table


def unfolded(report: str) -> list[str]:
    """The paragraphs of a report that are not folded away."""
    kept, folded = [], False
    for paragraph in report.split("\n\n"):
        folded = folded or paragraph.startswith(OPEN)
        if not folded:
            kept.append(paragraph)
        folded = folded and CLOSE not in paragraph
    return kept


def findings(report: str) -> list[str]:
    """The lines that begin with a dash."""
    lines = [line for paragraph in unfolded(report) for line in paragraph.splitlines()]
    return [line.removeprefix("- ") for line in lines if line.startswith("- ")]


def captions(report: str) -> list[str]:
    """The paragraphs that follow a picture."""
    paragraphs = unfolded(report)
    return [after for before, after in itertools.pairwise(paragraphs) if before.startswith("![")]


def too_long(report: str) -> list[str]:
    """Every finding and every caption with too many characters, with how many it has."""
    kinds = (("finding", findings(report), MOST_OF_FINDING), ("caption", captions(report), MOST_OF_CAPTION))
    return [f"{kind} of {len(text)}: {text}" for kind, texts, most in kinds for text in texts if len(text) > most]


def test_every_finding_and_caption_of_the_stored_report_is_short():
    report = REPORT.read_text(encoding="utf-8")
    assert len(findings(report)) > 50  # there is something to judge
    assert len(captions(report)) > 20
    offending = too_long(report)
    assert not offending, "\n\n".join(offending)


@pytest.mark.parametrize(
    ("finding", "caption", "kinds"),
    [
        (MOST_OF_FINDING, MOST_OF_CAPTION, []),
        (MOST_OF_FINDING + 1, MOST_OF_CAPTION, ["finding of 401"]),
        (MOST_OF_FINDING, MOST_OF_CAPTION + 1, ["caption of 701"]),
    ],
)
def test_one_character_too_many_is_found(finding, caption, kinds):
    report = f"## Study\n\n- Short.\n- {'x' * finding}\n\n![Alt](figures/a.png)\n\n{'y' * caption}\n\nOther words.\n"
    assert [one.partition(":")[0] for one in too_long(report)] == kinds


def test_what_is_folded_away_may_be_long_and_what_follows_may_not():
    long = "x" * (MOST_OF_FINDING + 1)
    folded = f"<details><summary>Table</summary>\n\n- {long}\n\n</details>"
    assert too_long(folded) == []
    assert len(too_long(f"{folded}\n\n- {long}\n")) == 1
