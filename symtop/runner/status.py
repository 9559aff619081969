"""What is known of every case of a study, and why a case has to be computed.

    done       a file holds what this version computes
    failed     it failed, and is tried again by the next run
    stale      it was computed, and something that its numbers depend on has changed since
    missing    it was never computed with these settings

The reasons that are stored in a case's file are compared with the present ones, label by label.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from symtop.core import code_hash
from symtop.runner import fingerprint, store
from symtop.runner.cases import StudyCases
from symtop.runner.study import Case, Study

DONE, FAILED, STALE, MISSING = STATES = ("done", "failed", "stale", "missing")


def status(
    study: Study, results: Path, *, quick: bool = False, full: bool = False, why: bool = False
) -> list[dict[str, Any]]:
    """Scene, integrator, state and message of every case; with `why` also what has changed since it was computed.

    The second round of a study is known only when its first is done.
    """
    cases = StudyCases.stored(study, results, quick=quick, full=full)
    stored = store.stored(cases.results, study)
    older = store.superseded(stored, cases.cases)
    rows = []
    for path, case in cases.cases.items():
        record = store.read_json(store.failure_path(path))
        earlier = [old for old in older if store.identity_of(old) == store.identity_of(path)]
        message, causes = "", list[str]()
        if path in cases.data:
            state = DONE
        elif isinstance(record, dict):
            state, message = FAILED, str(record.get("message", ""))
        elif earlier:
            state = STALE
            causes = changed(study, case, max(earlier, key=lambda old: old.stat().st_mtime)) if why else []
        else:
            state, causes = MISSING, other_settings(case, stored) if why else []
        row = {"scene": case.scene, "integrator": case.integrator, "state": state, "message": message}
        rows.append(row | ({"why": causes} if why else {}))
    return rows


def changed(study: Study, case: Case, path: Path) -> list[str]:
    """What a case depends on that is not what it was when a file was computed: labels of a fingerprint."""
    before = _attribute(path, "made_of")
    if not before:
        return ["its file does not say what it was made of"]
    return code_hash.changes(before, store.short(fingerprint.reasons(study, case)))


def other_settings(case: Case, stored: list[Path]) -> list[str]:
    """How the settings of a case differ from the nearest that were computed on its scene with its integrator."""
    alike = [path for path in stored if store.identity_of(path).rpartition("--")[0] == case.label]
    settings = [_attribute(path, "settings") for path in alike]
    wanted = json.loads(json.dumps(dict(case.settings)))
    differing = [
        sorted(name for name in {*old, *wanted} if old.get(name, "") != wanted.get(name, "")) for old in settings
    ]
    return [f"setting {name}" for name in min(differing, key=len, default=[])] if settings else ["never computed"]


def _attribute(path: Path, name: str) -> Mapping[str, Any]:
    """A mapping that a case's file holds; empty if the file is damaged or another program's."""
    data = store.load_case(path)
    content = {} if data is None else data.attrs.get(name)
    return content if isinstance(content, dict) else {}
