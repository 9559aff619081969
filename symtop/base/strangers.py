"""The door to code that somebody else has written: whatever it raises is said in one sentence.

A plug-in's solver, the measure of a user's study or a file that is loaded may raise anything: errors beside
`Exception`, a request to exit, an interrupt of its own, an error that cannot be printed. None of them may end a command
in its place. What the user asks for passes: Ctrl-C, where `told_apart` (`symtop.base.signals`) can tell, and SIGTERM.
"""

from types import TracebackType

from symtop.base.signals import is_of_user
from symtop.base.validate import SymtopError

LONGEST = 300  # characters of a stranger's words


def words_of(error: BaseException) -> str:
    """The type of an error and what it says, in one line, if it can be said."""
    try:
        said = " ".join(str(error).split())
    except Exception:  # noqa: BLE001  (its own __str__ may raise anything)
        return f"{type(error).__name__}, which cannot be printed"
    cut = said if len(said) <= LONGEST else f"{said[:LONGEST]} ..."
    return f"{type(error).__name__}: {cut}" if cut else type(error).__name__


class door:
    """Within it, whatever is raised becomes a SymtopError: `what` failed, and how. A SymtopError passes as it is."""

    __slots__ = ("what",)

    def __init__(self, what: str) -> None:
        self.what = what

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is not None and not isinstance(error, SymtopError) and not is_of_user(error):
            raise SymtopError(f"{self.what} failed: {words_of(error)}") from error
