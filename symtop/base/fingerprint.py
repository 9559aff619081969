"""What a number was made of: a mapping from labels to hashes, found without running anything.

    file symtop/methods/gauss.py                     a file that counts as a whole
    function symtop_studies/drift/study.py:measure   a function that counts by its code
    constant symtop_studies/drift/study.py:STEPS     a value that such a function names
    integrator gauss-2, scene goldstein, settings    values: coefficients, numbers, what a case is given
    package numba, python, processor                 where it was computed

The digest of a mapping is the hash of all of it; two mappings are compared label by label, which says *why* a stored
number is stale. Cases of studies, cached kernels and references, checkpoints and plug-ins are all told apart this way.
`symtop.base.walk` finds the labels of a value.
"""

import contextlib
import functools
import hashlib
import importlib.metadata
import platform
from collections.abc import Iterable, Mapping
from pathlib import Path

from symtop.base.imports import root_of, roots

Reasons = dict[str, str]

LENGTH = 20  # hexadecimal digits of a digest
COMPUTING = ("numpy", "scipy", "numba", "heyoka", "xarray", "netCDF4", "mpmath")  # packages that numbers pass through


def hashed(*parts: str) -> str:
    """Hash of some text, 20 hexadecimal digits."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:LENGTH]


def digest(reasons: Mapping[str, str]) -> str:
    """The hash of a mapping."""
    return hashed(*(f"{label}\t{reasons[label]}" for label in sorted(reasons)))


def changes(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """The labels in which two mappings differ, and how."""
    labels = [label for label in sorted(before) if label in now and now[label] != before[label]]
    labels += [f"{label} (no longer counts)" for label in sorted(set(before) - set(now))]
    return labels + [f"{label} (did not count before)" for label in sorted(set(now) - set(before))]


def merged(mappings: Iterable[Mapping[str, str]]) -> Reasons:
    """All labels of some mappings; a label with several hashes has the hash of them all."""
    hashes: dict[str, set[str]] = {}
    for mapping in mappings:
        for label, value in mapping.items():
            hashes.setdefault(label, set()).add(value)
    return {label: values.pop() if len(values) == 1 else hashed(*sorted(values)) for label, values in hashes.items()}


@functools.cache
def file_hash(path: Path) -> str:
    """Hash of a file as it was when it was first asked for."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:LENGTH]


def file_label(path: Path) -> str:
    """The name of a file: with its package if that is known, by itself otherwise."""
    root = root_of(path)
    return _within(root, roots[root], path) if root else path.name


@functools.cache  # 60 us in Python 3.12, asked for twice for each function of a kernel
def _within(root: str, folder: Path, path: Path) -> str:
    return f"{root}/{path.relative_to(folder).as_posix()}"


def file_reasons(files: Iterable[Path]) -> Reasons:
    """Hashes of files."""
    return {f"file {file_label(path)}": file_hash(path) for path in files}


@functools.cache
def version(package: str) -> str:
    """The installed version of a package, or ``absent``."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "absent"


@functools.cache
def processor() -> str:
    """The name of this machine's processor."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def packages(*names: str) -> Reasons:
    """Versions of packages; by default those that numbers pass through, and Python, whose code differs by version."""
    python = {} if names else {"package python": ".".join(platform.python_version_tuple()[:2])}
    return {f"package {name}": version(name) for name in names or COMPUTING} | python
