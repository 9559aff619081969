"""The public face: names, their homes, and the words that their arguments share."""

import importlib
import inspect
import pkgutil
import types

import symtop


def test_every_public_name_is_there_and_in_the_block_for_checkers():
    text = inspect.getsource(symtop)
    for name in symtop.__all__:
        assert getattr(symtop, name) is not None
        assert name == "__version__" or f"{name} as {name}" in text


def test_no_function_has_the_name_of_a_package_beside_it():
    places = {entry.name for entry in pkgutil.iter_modules(symtop.__path__)}
    assert not places & set(symtop.__all__)
    for package in ("core", "model", "methods", "run", "measure", "judging"):
        module = importlib.import_module(f"symtop.{package}")
        for entry in pkgutil.iter_modules(module.__path__):
            assert isinstance(importlib.import_module(f"symtop.{package}.{entry.name}"), types.ModuleType)
