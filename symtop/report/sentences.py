"""Lists in a sentence: a few names are joined as one says them, many are counted, since a long list is a table's."""

from collections.abc import Sequence

FEW = 4  # names that a sentence has; the others are counted


def joined(words: Sequence[str]) -> str:
    """A list as a sentence has it."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + f" and {words[-1]}" if words else "none"


def abridged(names: Sequence[str], most: int = FEW) -> str:
    """The first names of a list, and how many more there are."""
    return joined(names) if len(names) <= most else f"{', '.join(names[:most])} and {len(names) - most} more"


def counted(count: int, noun: str = "variant") -> str:
    """So many things: ``1 variant``, ``12 variants``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def few(names: Sequence[str], noun: str = "variant", most: int = FEW) -> str:
    """The names, if they are at most so many; otherwise how many there are."""
    return ", ".join(names) if len(names) <= most else counted(len(names), noun)
