"""What a case's numbers depend on, found without running it: a mapping from labels to hashes (`core.code_hash`).

A case is measured by a function of its study, on a scene, with one integrator or several. Each of them is walked. The
registry imports the families of integrators by name and leads to none of them: a case depends on the files of the
integrators that it runs. Editing `methods/runge_kutta/gauss.py` makes the cases of the Gauss methods stale and no
other.

A case runs the integrators that its study declares (`Study.uses`), or the one it names and any that the code of its
measure may look up: literal names in a file that asks for integrators or runs, and all of them where a file asks the
registry by its own choice. `simulate` and the registry look up what they are given, and what is reached only through
them (the guard, which runs pieces of a method) makes a sentence and no number.
"""

import ast
import functools
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from symtop.core import code_hash, netcdf
from symtop.core.code_hash import Reasons, Walk
from symtop.methods.framework import registry
from symtop.methods.framework.registry import Integrator, integrators, split_name, variants
from symtop.model.scenes import scenes
from symtop.run import simulation
from symtop.runner import plugins
from symtop.runner.study import Case, Study

EVERY = "*"  # in place of an integrator's or a scene's name: all of them
ASKING = {
    "integrator",
    "integrators",
    "variants",
    "registry",
    "simulate",
}  # names whose import means that a file may run a method
RESOLVERS = frozenset(Path(str(module.__file__)).resolve() for module in (simulation, registry))


@functools.cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_bytes())


def _asks_for(file: Path) -> set[str]:
    """Names by which a file imports integrators, the registry or runs from a known package."""
    statements = code_hash.imported(file)
    return {name for module, names in statements if module.split(".")[0] in code_hash.roots for name in names} & ASKING


def _may_run_any(file: Path) -> bool:
    """Does a file ask the registry for integrators of its own choice?

    It does if it imports all of them, or calls `integrator` on anything but a literal name, which is found as a string,
    and an argument of the function around it, which its caller chooses.
    """
    names = _asks_for(file)
    if names & {"integrators", "variants", "registry"}:
        return True
    tree = _tree(file)
    imported = [alias for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names]
    aliases = {alias.asname or alias.name for alias in imported if alias.name == "integrator"}
    harmless: set[ast.AST] = set()
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            given = {argument.arg for argument in ast.walk(function.args) if isinstance(argument, ast.arg)}
            for node in ast.walk(function):
                if isinstance(node, ast.Name) and node.id in given:  # not what was imported under that name
                    harmless.add(node)
                elif isinstance(node, ast.Call) and len(node.args) == 1:
                    (chosen,) = node.args
                    if isinstance(chosen, ast.Constant) or (isinstance(chosen, ast.Name) and chosen.id in given):
                        harmless.add(node.func)
    uses = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in aliases]
    return any(node not in harmless for node in uses)


def _strings(file: Path) -> set[str]:
    nodes = ast.walk(_tree(file))
    return {node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)}


class Basis(NamedTuple):
    """What measuring depends on besides the integrator: values, files, and integrators it may run itself."""

    values: Reasons
    files: frozenset[Path]
    names: frozenset[str]  # integrators that it names, or EVERY if it may run any


@functools.cache
def basis(measure: Callable[..., Any]) -> Basis:
    """What a study's measure depends on."""
    walk = Walk("measure")
    walk.add(measure)
    asking = [file for file in code_hash.closure(walk.files, RESOLVERS) - RESOLVERS if _asks_for(file)]
    names = walk.strings.union(*map(_strings, asking)) & integrators().keys()
    if {integrators, variants} & walk.functions or any(map(_may_run_any, asking)):
        names.add(EVERY)
    return Basis(walk.values(), walk.closure(), frozenset(names))


_walked: dict[int, tuple[Integrator, Reasons, frozenset[Path]]] = {}


def _of_integrator(entry: Integrator) -> tuple[Reasons, frozenset[Path]]:
    """Values and files of an integrator; the entry is held, so that no other can take its id."""
    if id(entry) not in _walked:
        walk = Walk(f"integrator {entry.name}")
        walk.add(entry)
        _walked[id(entry)] = entry, walk.values(), walk.closure()
    return _walked[id(entry)][1:]


def used(study: Study, case: Case) -> list[str]:
    """Names of the integrators that a case runs: what the study declares, or everything that it might run."""
    if study.uses is not None:
        names = set(study.uses(case))
    else:
        names = {case.integrator, *case.settings.get("integrators", ()), *basis(study.measure).names}
    known = integrators().keys()
    return sorted(known if EVERY in names else {split_name(name)[0] for name in names} & known)


def settings_key(study: Study, case: Case) -> str:
    """Hash of what a case was asked to do, which an edit of the code does not change."""
    return code_hash.hashed(
        json.dumps([study.name, case.scene, case.integrator, case.group, dict(case.settings)], sort_keys=True)
    )


def reasons(study: Study, case: Case) -> Reasons:
    """Everything that a case's numbers depend on: settings, scene, integrators, sources, versions."""
    return _asked(study, case) | _shared(study, case.scene, tuple(used(study, case)))


def _asked(study: Study, case: Case) -> Reasons:
    """What a case alone depends on."""
    processor = {"processor": netcdf.provenance()["processor"]} if study.is_timed(case) else {}
    return {"settings": settings_key(study, case), **processor}


def _shared(study: Study, place: str, names: Iterable[str]) -> Reasons:
    """What all cases of a study on a scene with the same integrators depend on."""
    methods, catalogue = integrators(), scenes()
    base = basis(study.measure)
    walked = [_of_integrator(methods[name]) for name in names]
    walk = Walk("scene")
    for name in [place] if place != EVERY else sorted(catalogue):
        walk.add(catalogue.get(name), f"scene {name}")
    return {
        **code_hash.merged([base.values, walk.values(), *(values for values, _ in walked)]),
        **hashes(base.files.union(*(files for _, files in walked))),
        **plugins.reasons([place, *names]),
        **code_hash.packages(),
    }


@functools.lru_cache(maxsize=1024)
def hashes(files: frozenset[Path]) -> Reasons:
    """Hashes of files, each read once."""
    return code_hash.file_reasons(files)


def digest(study: Study, case: Case) -> str:
    """Hash of everything that a case's numbers depend on."""
    return digests(study, [case])[0]


def digests(study: Study, cases: Iterable[Case]) -> list[str]:
    """The digests of many cases; what they share is looked up once, in a third of the time."""
    shared: dict[tuple[str, ...], Reasons] = {}

    def of(case: Case) -> str:
        names = tuple(used(study, case))
        if (case.scene, *names) not in shared:
            shared[case.scene, *names] = _shared(study, case.scene, names)
        return code_hash.digest(_asked(study, case) | shared[case.scene, *names])

    return [of(case) for case in cases]


def script_digest(script: Path, *drawing: object) -> str:
    """Hash of what makes a study's pictures, tables and verdict: its script, all that it imports, and `drawing`."""
    walk = Walk("drawing", files={script})
    walk.add(drawing)
    return code_hash.digest(code_hash.packages("matplotlib") | walk.values() | hashes(walk.closure()))
