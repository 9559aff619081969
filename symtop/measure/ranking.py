"""Which variants, methods in one chart, are the fastest on random tops: the table ``candidates.tsv``.

It was made from a stored study of cost (`benchmarks/candidates.py`), which counts force evaluations on random tops and
measures what one costs. A row holds the variants that between them were next to the cheapest on most random tops of
every kind, for an accuracy of a quantity, a length in nutations, a class of `NEEDS`, and, in some, only of methods that
exist for a body without symmetry. Made from half of the tops, five of a row come within 1.1 times the least on 96 to
100 % of the others over 10 nutations, and on 88 to 100 % over 1000.
"""

import functools
import math
from collections.abc import Collection
from pathlib import Path

SHOWN_AS = {"theta": "axis"}  # quantities that the study has under another name
TABLE = Path(__file__).with_name("candidates.tsv")
ASKED = ("nutations", "quantity", "accuracy", "needs", "general")  # columns of the table, before the variants
ANY = "any"  # class of needs: whatever is not made for this very top
MENU = 6  # variants in a row


@functools.cache
def _rows() -> dict[tuple[float, str, float, str, bool], list[str]]:
    lines = (line.split("\t") for line in TABLE.read_text(encoding="utf-8").splitlines()[1:])
    return {(float(n), what, float(a), need, g == "yes"): names.split(" ") for n, what, a, need, g, names in lines}


def cheapest(
    needs: Collection[str], quantity: str, accuracy: float, nutations: float, *, general: bool = False
) -> list[str]:
    """Variants of the classes `needs` (empty: `ANY`), mostly the cheapest first; none where the table says nothing.

    Accuracy and length are the nearest in the table, in logarithms. Of several classes the firsts of all come first.
    """
    rows, shown = _rows(), SHOWN_AS.get(quantity, quantity)
    length = min({key[0] for key in rows}, key=lambda value: abs(math.log(value / max(nutations, 1e-3))))
    level = min({key[2] for key in rows}, key=lambda value: abs(math.log(value / accuracy)))
    menus = [rows.get((length, shown, level, need, general), []) for need in needs or (ANY,)]
    return list(dict.fromkeys(name for place in range(MENU) for menu in menus for name in menu[place : place + 1]))
