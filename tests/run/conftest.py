"""A folder for references and certificates that is empty when a test begins."""

import numpy as np
import pytest

import symtop
from symtop.model.exact import closed_form
from symtop.run.reference import truth
from symtop.run.reference.independent_checks import iterate_map


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """It holds no kernels: those of the closed form and of the discrete map are loaded before."""
    closed_form.compile_now()
    iterate_map(symtop.scene("goldstein"), np.array([0.1]))
    monkeypatch.setenv("SYMTOP_CACHE", str(tmp_path))
    truth._on_disk.cache_clear()
    return tmp_path
