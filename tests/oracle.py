"""Hashes of every stored number and finding of a results folder, to hold a change of structure against.

    python tests/oracle.py RESULTS OTHER --stable TWICE_A TWICE_B    compare two folders, but for what varies

A dataset's variables are hashed cell by cell, a cell being a (scene, variant, ...) of the labelled dimensions, so that
the name of a dimension and the order of its labels do not count. Variables and sentences that differ between two runs
of one version hold times; they are left out.
"""

import argparse
import hashlib
import itertools
import json
import re
from pathlib import Path

import numpy as np
import xarray as xr

RENAMED = {"integrator": "variant", "row": "variant"}  # dimensions and coordinates; "row" is "variant" in texts, too
LABELS = "OU"  # kinds of coordinates that name things: strings


def _digest(values: np.ndarray) -> str:
    data = np.ascontiguousarray(values)
    raw = repr(data.tolist()).encode() if data.dtype.kind in LABELS else data.tobytes()
    return hashlib.sha256(f"{data.dtype.kind}{data.shape}".encode() + raw).hexdigest()[:16]


def of_dataset(data: xr.Dataset, prefix: str) -> dict[str, str]:
    """Hash of each variable by the labels of its cell."""
    hashes = {}
    for name, variable in data.variables.items():
        named = [
            dim
            for dim in variable.dims
            if dim != name and dim in data.coords and data[dim].dtype.kind in LABELS and data[dim].ndim == 1
        ]
        whole = data[name].transpose(*named, *(dim for dim in variable.dims if dim not in named)).values
        labels = [data[dim].values.tolist() for dim in named]
        if name in data.dims and whole.dtype.kind in LABELS:
            whole = np.sort(whole.astype(str))
        for place in itertools.product(*(range(len(texts)) for texts in labels)):
            cell = ", ".join(sorted(texts[i] for texts, i in zip(labels, place, strict=True)))
            hashes[f"{prefix} {RENAMED.get(name, name)} {cell}"] = _digest(whole[place])
    return hashes


def _text(said: object) -> str:
    """The hash of a finding or of a table's line, the old word for a variant replaced."""
    plain = re.sub(r"\brow(s?)\b", r"variant\1", str(said).lower())
    return hashlib.sha256(plain.encode()).hexdigest()[:16]


def of_folder(results: Path) -> dict[str, str]:
    """Hashes of all datasets and findings of a folder."""
    hashes = {}
    for path in sorted(results.glob("*.nc")):
        with xr.open_datatree(path) as tree:  # noqa: TID251
            for node in tree.subtree:
                hashes |= of_dataset(node.to_dataset(inherit=False).load(), f"{path.name}{node.path}")
    for path in sorted(results.glob("*.json")):
        found = json.loads(path.read_text())
        for index, text in enumerate(found.get("verdict", [])):
            hashes[f"{path.name} finding {index}"] = _text(text)
        for place, table in enumerate(found.get("tables", [])):
            for index, row in enumerate(table["rows"]):
                hashes[f"{path.name} table-{place} {index}"] = _text(row)
    return hashes


def differing(one: dict[str, str], other: dict[str, str]) -> set[str]:
    """Keys whose hashes differ or that only one of them has."""
    return {key for key in one.keys() | other.keys() if one.get(key) != other.get(key)}


def _variable(key: str) -> str:
    return " ".join(key.split(" ")[:2])


def main() -> None:
    """Compare."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folders", nargs=2, type=Path)
    parser.add_argument("--stable", nargs=2, type=Path, default=())
    parser.add_argument("--most", type=int, default=40)
    arguments = parser.parse_args()
    one, other = map(of_folder, arguments.folders)
    noisy = differing(*map(of_folder, arguments.stable)) if arguments.stable else set()
    noisy_variables = {_variable(key) for key in noisy if ".nc" in key}
    wrong = [key for key in sorted(differing(one, other)) if key not in noisy and _variable(key) not in noisy_variables]
    counted = sum(key not in noisy and _variable(key) not in noisy_variables for key in one)
    print(f"{counted} hashes compared, {len(one) - counted} left out as times, {len(wrong)} differ")
    print("left out:", ", ".join(sorted(noisy_variables)))
    for key in wrong[: arguments.most]:
        print(" ", "missing" if key not in other else "new" if key not in one else "differs", key)


if __name__ == "__main__":
    main()
