"""BibTeX entries of the methods: `citations.bib`, by the keys that `Integrator.reference` names."""

import functools
import re
from importlib import resources

from symtop.core.errors import SymtopError
from symtop.methods.framework.registry import Integrator, integrator


@functools.cache
def bibliography() -> dict[str, str]:
    """The text of every entry, by its key. An entry begins with @ in the first column and ends with } there."""
    text = resources.files("symtop.methods").joinpath("citations.bib").read_text(encoding="utf-8")
    return {
        match["key"]: match[0]
        for match in re.finditer(r"^@\w+\{(?P<key>[^,\s]+),$.*?^\}", text, re.MULTILINE | re.DOTALL)
    }


def citation_keys(method: Integrator) -> list[str]:
    """The entries that an integrator's `reference` names; a reference may also be plain words."""
    return [key for key in method.reference.replace(",", " ").split() if key in bibliography()]


def citation(name: "str | Integrator") -> str:
    """BibTeX of the source of an integrator, by its name.

    Raises SymtopError for an unknown name, or if the integrator names no source that is known here.
    """
    method = integrator(name)
    named = citation_keys(method)
    if not named:
        raise SymtopError(
            f"integrator {method.name!r} names no source that is known here (its reference is {method.reference!r})"
        )
    return "\n\n".join(bibliography()[key] for key in named)
