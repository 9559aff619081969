"""Formulas written once, in plain text, and shown as MathML: no network, no script, and a screen reader can read them.

The notation is that of the docstrings:

    L = I1/2 (theta'^2 + phi'^2 sin^2 theta) + I3/2 (psi' + phi' cos theta)^2 - mgl cos theta

A Greek name is its letter; a digit after a letter, or what follows `_`, is an index; a prime is a derivative with
respect to time, shown as a dot. `^` raises to one atom. `/` without spaces around it makes a fraction of the two atoms
beside it and takes away their brackets. A function in `UPRIGHT` is set upright, `x` is the vector product, and other
names are products of letters: `mgl`, `dtheta`.
"""

import re

from symtop.core.errors import SymtopError

GREEK = {
    "alpha": "α", "beta": "β", "delta": "δ", "theta": "θ", "phi": "φ", "psi": "ψ", "tau": "τ",
    "omega": "ω", "Omega": "Ω",
}  # fmt: skip
UPRIGHT = {"sin", "cos", "sn", "asin", "atan2", "max", "min"}
SIGNS = {"-": "−", "<=": "≤", "<": "&lt;", ">": "&gt;"}
TOKEN = re.compile(
    r"(?P<space>\s*)(?:(?P<number>\d+(?:\.\d+)?)|(?P<name>atan2|[A-Za-z]+)|(?P<sign><=|[-+=/^_'(),|<>\[\]]))"
)
DOTS = {1: "˙", 2: "¨"}
PAIRS = {"(": ")", "[": "]"}


def mathml(formula: str) -> str:
    """A formula as a ``math`` element; SymtopError for one that cannot be read."""
    reader = _Reader(formula)
    return f'<math display="block"><mrow>{reader.row("")}</mrow></math>'


class _Reader:
    """Reads a formula from left to right: a row of atoms and signs, some of which are fractions."""

    def __init__(self, formula: str) -> None:
        self.formula, self.place = formula, 0
        self.tokens: list[tuple[str, str, bool]] = []  # kind, text, and whether a space stands before it
        end = 0
        while formula[end:].strip():
            token = TOKEN.match(formula, end)
            if token is None:
                raise SymtopError(f"formula {formula!r} has an unknown sign: {formula[end:].strip()!r}")
            kind = str(token.lastgroup)
            self.tokens.append((kind, token[kind], bool(token["space"])))
            end = token.end()

    def next_is(self, text: str, *, close: bool = False) -> bool:
        """Does that token come next, and, if it must be close, without a space before it?"""
        if self.place >= len(self.tokens):
            return text == ""
        _, written, spaced = self.tokens[self.place]
        return written == text and not (close and spaced)

    def took(self, text: str, *, close: bool = False) -> bool:
        """Pass over that token if it comes next."""
        here = bool(text) and self.next_is(text, close=close)
        self.place += here
        return here

    def row(self, end: str) -> str:
        """All up to the token `end`, which is passed over."""
        parts = []
        while not self.next_is(end):
            parts.append(self.term())
        self.took(end)
        return "".join(parts)

    def term(self) -> str:
        """An atom, or two with a fraction bar between them."""
        above, bare = self.atom()
        if self.took("/", close=True):
            return f"<mfrac>{bare}{self.atom()[1]}</mfrac>"
        return above

    def atom(self) -> tuple[str, str]:
        """The next atom with the index, the dots and the power that cling to it; once more without its brackets."""
        if self.place >= len(self.tokens):
            raise SymtopError(f"formula {self.formula!r} ends too early")
        kind, text, _ = self.tokens[self.place]
        self.place += 1
        if text in PAIRS:
            inside = self.row(PAIRS[text])
            whole, bare = f"<mrow><mo>{text}</mo>{inside}<mo>{PAIRS[text]}</mo></mrow>", f"<mrow>{inside}</mrow>"
        elif kind == "name":
            whole = bare = self.name(text)
        elif kind == "number":
            whole = bare = f"<mn>{text}</mn>"
        else:
            whole = bare = f"<mo>{SIGNS.get(text, text)}</mo>"
        if self.took("^", close=True):
            whole = bare = f"<msup>{whole}{self.atom()[0]}</msup>"
        if text in UPRIGHT and not self.next_is("("):
            whole = bare = whole + "<mo>&#x2061;</mo>"  # applied to what follows
        return whole, bare

    def name(self, text: str) -> str:
        """A name with its index and dots."""
        if text == "x":
            return "<mo>×</mo>"
        small, rest = ("d", text[1:]) if text[0] == "d" and text[1:] in GREEK and text not in GREEK else ("", text)
        letters = [GREEK[rest]] if rest in GREEK else [rest] if rest in UPRIGHT else list(rest)
        letters = [*small, *letters]
        shown = "".join(f"<mi>{letter}</mi>" for letter in letters)
        dots = 0
        while self.took("'", close=True):
            dots += 1
        if dots:
            shown = f'<mover accent="true">{shown}<mo>{DOTS[dots]}</mo></mover>'
        following = self.tokens[self.place] if self.place < len(self.tokens) else ("", "", True)
        if following[0] == "number" and not following[2] and text not in UPRIGHT:
            self.place += 1
            shown = f"<msub>{shown}<mn>{following[1]}</mn></msub>"
        elif self.took("_", close=True):
            shown = f"<msub>{shown}{self.atom()[1]}</msub>"
        return f"<mrow>{shown}</mrow>" if len(letters) > 1 else shown
