"""Lists inside a sentence: a few things are named, many are counted, since a long list belongs in a table."""

from collections.abc import Sequence

MOST = 4  # names in a sentence


def counted(count: int, noun: str = "row") -> str:
    """So many things: ``1 row``, ``12 rows``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def few(names: Sequence[str], noun: str = "row", most: int = MOST) -> str:
    """The names, if they are at most so many; otherwise how many there are."""
    return ", ".join(names) if len(names) <= most else counted(len(names), noun)
