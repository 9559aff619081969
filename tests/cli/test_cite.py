"""``symtop cite``: every key exists, every built-in method with a source is cited, and a stranger's is said."""

import re

import pytest

import symtop
from symtop.core import netcdf
from symtop.methods.framework.registry import bibliography, citation_keys
from tests.commands import call


def cited(*arguments):
    return call("cite", *arguments)


def test_without_a_file_the_package_is_cited_with_its_version():
    text = cited().stdout
    assert re.findall(r"^@(\w+)", text, re.MULTILINE) == ["software"]
    assert f"version = {{{symtop.__version__}}}" in text


@pytest.mark.parametrize("name", ["strang", "gauss-4", "midpoint"])
def test_a_run_cites_the_sources_of_its_method(tmp_path, name):
    data = symtop.simulate("spheroid", name, step_size=0.01, horizon=0.1)
    file = netcdf.write(data, tmp_path / "run.nc")
    text = cited(file, file).stdout
    sources = citation_keys(symtop.integrator(name))
    assert sources
    for key in sources:
        assert bibliography()[key] in text
    assert text.count("\n@") == len(sources)  # once each


def test_a_method_without_a_known_source_is_said(tmp_path):
    data = symtop.simulate("spheroid", "strang", step_size=0.01, horizon=0.1).assign_attrs(integrator="of-a-user")
    result = cited(netcdf.write(data, tmp_path / "run.nc"))
    assert "no source is known of of-a-user" in result.stderr
    assert result.stdout.count("@") == 1
