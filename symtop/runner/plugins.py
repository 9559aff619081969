"""Plug-ins: a user's Python file that registers integrators and scenes of its own.

A plug-in counts with the files of its folder that it imports, each by a label of its own: by import statements,
wherever they stand, and by what was loaded while it ran, under a name that is made at run time. Another file beside it
counts for nothing. If the folder is a package, names that begin with the package's are found, too.
"""

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from symtop.core import code_hash
from symtop.core.errors import SymtopError, foreign_code
from symtop.core.python_files import execute, python_file
from symtop.methods.framework.registry import integrators, is_built_in, split_name
from symtop.model.scenes import added_scenes, scenes

_loaded: dict[Path, code_hash.Reasons] = {}  # files of plug-ins in use, with what they were made of
_owners: dict[str, Path] = {}  # of an integrator or a scene: its plug-in


def load(path: str | Path) -> list[str]:
    """Run a plug-in file once; what it registers, whose names are returned, is then known to studies and commands."""
    file = python_file(path, "plugin", "a Python file")
    if file in _loaded:
        return _registered_by(file)
    before = [*integrators().values(), *scenes().values()]
    modules = set(sys.modules)
    with foreign_code(f"plugin {file.name}"):
        try:
            execute(f"symtop_plugin_{file.stem}", file)
        except SymtopError as error:  # the names in it are the file's, and no options of a command
            raise SymtopError(f"plugin {file.name}: {error}") from error
    parts = sorted(_parts(file, set(sys.modules) - modules))
    labels = {path: f"file {path.relative_to(file.parent).as_posix()} of plug-in {file.name}" for path in parts}
    labels[file] = f"plug-in {file.name}"
    _loaded[file] = {label: code_hash.file_hash(path) for path, label in labels.items()}
    for name, entry in (*integrators().items(), *scenes().items()):
        if not any(entry is known for known in before):
            _owners[name] = file
    return _registered_by(file)


def _parts(plugin: Path, new: Iterable[str]) -> set[Path]:
    """The files of a plug-in's folder that it imports, those that they import, and so on, and the plug-in."""
    parts: set[Path] = set()
    ahead = {plugin, *(path for name in new for path in _file_of(name, plugin.parent))}
    while ahead:
        parts |= ahead
        ahead = {path for file in ahead for path in _imported(file, plugin.parent)} - parts
    return parts


def _imported(file: Path, folder: Path) -> Iterator[Path]:
    """The files of a folder that a file of it imports: loaded modules, or files where the statements say."""
    above = [place for place in (file.parent, *file.parent.parents) if folder in (place, *place.parents)]
    if (folder / "__init__.py").is_file():
        above.append(folder.parent)
    try:
        statements = code_hash.imported(file)
    except (OSError, ValueError):
        return
    for module, names in statements:
        for dotted in (module, *(f"{module}.{name}".lstrip(".") for name in names)):
            yield from _file_of(dotted, folder)
            steps = [step for step in dotted.split(".") if step]
            for place in above:
                for k in range(len(steps)):
                    path = place.joinpath(*steps[: k + 1])
                    yield from (one for one in (path.with_name(f"{path.name}.py"), path / "__init__.py")
                                if _counts(one, folder))  # fmt: skip


def _file_of(module: str, folder: Path) -> Iterator[Path]:
    """The file of a loaded module, if it is one of the folder's."""
    file = getattr(sys.modules.get(module), "__file__", None)
    if isinstance(file, str) and file.endswith(".py") and _counts(path := Path(file).resolve(), folder):
        yield path


def _counts(file: Path, folder: Path) -> bool:
    """Is it a file of the folder, and of no package that counts in another way, or by its version?"""
    if folder not in file.parents or not file.is_file() or code_hash.root_of(file.resolve()):
        return False
    return "site-packages" not in file.parts and not any(
        Path(prefix) in file.parents and Path(prefix) not in (folder, *folder.parents)
        for prefix in (sys.prefix, sys.base_prefix)
    )


def _registered_by(file: Path) -> list[str]:
    return [name for name, owner in _owners.items() if owner == file]


def loaded() -> list[str]:
    """Paths of the plug-ins in use, in the order they were loaded."""
    return [str(path) for path in _loaded]


def reasons(names: Iterable[str]) -> code_hash.Reasons:
    """Hashes of the plug-ins that registered some integrators and scenes."""
    return code_hash.merged(_loaded[_owners[name]] for name in names if name in _owners)


def is_local(name: str) -> bool:
    """Was this integrator or scene registered by hand in this process, so that no other process can know it?"""
    name = split_name(name)[0]
    return name not in _owners and (name in added_scenes() or (name in integrators() and not is_built_in(name)))
