"""The fastest variants (a method in one chart) on random tops, read from the table ``candidates.tsv``.

The table comes from a stored study of cost (`benchmarks/candidates.py`), which counts force evaluations on random tops
and measures the time of one. A row is for one quantity, accuracy, length in nutations and class of `NEEDS`, and some
rows only for methods that exist for a body without symmetry. Its variants are a set of which, on most random tops of
every kind, at least one costs little more than the cheapest method. If rows are made from half of the tops, one of five
variants costs at most 1.1 times the least on 96 to 100 % of the other tops over 10 nutations, 88 to 100 % over 1000.
"""

import functools
import math
from collections.abc import Collection
from pathlib import Path

SHOWN_AS = {"theta": "axis"}  # quantities without rows of their own, and the quantity whose rows are used
TABLE = Path(__file__).with_name("candidates.tsv")
ANY = "any"  # class of needs: every method but those made for the symmetric top only
MENU_SIZE = 6  # variants in a row


@functools.cache
def _rows() -> dict[tuple[float, str, float, str, bool], list[str]]:
    lines = (line.split("\t") for line in TABLE.read_text(encoding="utf-8").splitlines()[1:])
    return {(float(n), shown, float(a), need, g == "yes"): names.split(" ") for n, shown, a, need, g, names in lines}


def cheapest(
    needs: Collection[str], quantity: str, accuracy: float, nutations: float, *, general: bool = False
) -> list[str]:
    """Variants of the classes `needs` (empty: `ANY`), mostly the cheapest first; none if the table has no such row.

    Accuracy and length are the nearest in the table, in logarithms. The rows of several classes are interleaved.
    """
    rows, column = _rows(), SHOWN_AS.get(quantity, quantity)
    length = min({key[0] for key in rows}, key=lambda value: abs(math.log(value / max(nutations, 1e-3))))
    level = min({key[2] for key in rows}, key=lambda value: abs(math.log(value / accuracy)))
    menus = [rows.get((length, column, level, need, general), []) for need in needs or (ANY,)]
    return list(dict.fromkeys(name for rank in range(MENU_SIZE) for menu in menus for name in menu[rank : rank + 1]))
