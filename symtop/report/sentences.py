"""Lists in a sentence: joined as one says them, and cut off where nobody reads on."""

from collections.abc import Sequence

FEW = 4  # names that a sentence has; the others are counted


def joined(words: Sequence[str]) -> str:
    """A list as a sentence has it."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + f" and {words[-1]}" if words else "none"


def abridged(names: Sequence[str], most: int = FEW) -> str:
    """The first names of a list, and how many more there are."""
    return joined(names) if len(names) <= most else f"{', '.join(names[:most])} and {len(names) - most} more"
