"""The fingerprint of a case: a hash of all that its numbers depend on, found without running it (`core.code_hash`).

It covers the measure function of the study, the scene and the integrators that the case runs (`Study.uses`), each by
the code that it calls and by its values. An edit of one method's coefficients thus makes only the cases of that method
stale. It also covers settings and versions of packages, and for timed cases the processor.
"""

import functools
import json

from symtop.core import code_hash
from symtop.core.code_hash import Reasons
from symtop.core.jit import code
from symtop.methods.framework.registry import integrators, split_name
from symtop.model.scenes import all_scenes, scenes
from symtop.runner.study import REFERENCE, Case, Study, failing

EVERY_NAME = "*"  # in place of an integrator's or a scene's name: all of them
# cache of `made_of` by label and id of an object; holding the object keeps its id valid
_known: dict[tuple[str, int], tuple[object, Reasons]] = {}
reached = functools.cache(code)  # the search for code, shared by all fingerprints of the process


def made_of(label: str, thing: object) -> Reasons:
    """The hashes of all code and values that an object leads to, at the first call for it."""
    key = label, id(thing)
    if key not in _known:
        _known[key] = thing, reached().reasons(label, thing)
    return _known[key][1]


def uses(study: Study, case: Case) -> list[str]:
    """Names of the integrators that a case runs, and of the closed form, which is the reference."""
    with failing(study.name, "uses"):
        names = {*(case.integrators if study.uses is None else study.uses(case)), REFERENCE}
    registry = integrators().keys()
    return sorted(registry if EVERY_NAME in names else {split_name(name)[0] for name in names} & registry)


def settings_key(study: Study, case: Case) -> str:
    """Hash of the declaration of a case, which does not depend on code."""
    question = [study.name, case.scene, case.integrator, case.group, dict(case.settings)]
    return code_hash.hashed(json.dumps(question, sort_keys=True))


def reasons(study: Study, case: Case) -> Reasons:
    """Everything that a case's numbers depend on: settings, scene, integrators, code, versions."""
    methods, catalogue = integrators(), all_scenes()
    scene_names = sorted(scenes()) if case.scene == EVERY_NAME else {case.scene} & catalogue.keys()
    parts = [made_of("measure", study.measure), code_hash.packages(), {"settings": settings_key(study, case)}]
    parts += [made_of(f"scene {name}", catalogue[name]) for name in scene_names]
    parts += [made_of(f"integrator {name}", methods[name]) for name in uses(study, case)]
    return code_hash.merged(parts) | ({"processor": code_hash.processor()} if study.is_timed(case) else {})


def digest(study: Study, case: Case) -> str:
    """Hash of everything that the numbers of a case depend on."""
    return code_hash.digest(reasons(study, case))
