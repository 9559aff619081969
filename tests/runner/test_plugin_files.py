"""A plug-in counts with the files of its folder that it imports, and no other; `study --status --why` names them."""

import subprocess
import sys

import pytest
from click.testing import CliRunner

from symtop.cli.main import main
from symtop.core.code_hash import changes
from symtop.runner import plugins

REGISTER = "import symtop\nsymtop.register(symtop.runge_kutta({name!r}, ((), (1.0,)), W, order=2))\n"
HERE = "import pathlib, sys\nsys.path.insert(0, str(pathlib.Path(__file__).parent{more}))\n"
CODE = """\
import sys
sys.path.insert(0, sys.argv[2])
{before}
from symtop.runner import plugins
(name,) = plugins.load(sys.argv[1])
for label, value in sorted(plugins.reasons([name]).items()):
    print(label, value, sep="\\t")
"""


def made_of(plugin, before=""):
    """What a new process says that the method of a plug-in is made of."""
    command = [sys.executable, "-c", CODE.format(before=before), str(plugin), str(plugin.parent)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True)
    return dict(line.split("\t") for line in done.stdout.splitlines())


def write(folder, **files):
    for name, text in files.items():
        file = folder / f"{name.replace('__', '/')}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return folder / "plug.py"


def test_a_file_that_nobody_imports_counts_for_nothing(tmp_path):
    plugin = write(tmp_path, plug="W = (0.5, 0.5)\n" + REGISTER.format(name="alone"), other="x = 1\n")
    before = made_of(plugin)
    assert list(before) == ["plug-in plug.py"]
    write(tmp_path, another="y = 2\n", other="x = 2\n")
    assert made_of(plugin) == before
    plugin.write_text(plugin.read_text() + "# changed\n")
    assert changes(before, made_of(plugin)) == ["plug-in plug.py"]


def test_what_is_imported_counts_and_is_named_wherever_the_import_stands(tmp_path):
    text = HERE.format(more="") + "from coeffs import W\nfrom sub.deep import V\n" + REGISTER.format(name="parts")
    text += "def late():\n    import lazily\n    import json, numpy\n"
    plugin = write(
        tmp_path, plug=text, coeffs="from base import A\nW = (A, A)\n", base="A = 0.5\n", lazily="", other="",
        sub__deep="from .near import V\n", sub__near="V = 1\n", sub__far="V = 2\n",
    )  # fmt: skip
    before = made_of(plugin)
    inside = ("base.py", "coeffs.py", "lazily.py", "sub/deep.py", "sub/near.py")
    assert set(before) == {"plug-in plug.py", *(f"file {name} of plug-in plug.py" for name in inside)}
    write(tmp_path, base="A = 1 / 2\n", sub__far="V = 3\n")
    assert changes(before, made_of(plugin)) == ["file base.py of plug-in plug.py"]
    for first in ("import coeffs", "import lazily, sub.deep, sub.far, other"):  # what a study has imported before it
        assert made_of(plugin, first) == made_of(plugin)


@pytest.mark.parametrize("statement", ["importlib.import_module('co' + 'effs')", "__import__('co' + 'effs')"])
def test_a_name_made_at_run_time_counts_once_it_was_loaded(tmp_path, statement):
    text = HERE.format(more="") + f"import importlib\nW = {statement}.W\n" + REGISTER.format(name="dynamic")
    plugin = write(tmp_path, plug=text, coeffs="W = (0.5, 0.5)\n", other="")
    assert list(made_of(plugin)) == ["file coeffs.py of plug-in plug.py", "plug-in plug.py"]


def test_a_module_of_a_folder_within_that_was_put_on_the_path(tmp_path):
    text = HERE.format(more=" / 'lib'") + "from coeffs import W\n" + REGISTER.format(name="within")
    plugin = write(tmp_path, plug=text, lib__coeffs="W = (0.5, 0.5)\n", lib__other="")
    assert list(made_of(plugin)) == ["file lib/coeffs.py of plug-in plug.py", "plug-in plug.py"]


def test_a_plugin_in_a_package_counts_with_what_it_imports_of_it(tmp_path):
    text = HERE.format(more=".parent") + "from mine.coeffs import W\n" + REGISTER.format(name="packed")
    folder = tmp_path / "mine"
    plugin = write(folder, plug=text, coeffs="from .base import W\n", base="W = (0.5, 0.5)\n", other="")
    (folder / "__init__.py").write_text("")
    labels = [label.removesuffix(" of plug-in plug.py") for label in made_of(plugin)]
    assert labels == ["file __init__.py", "file base.py", "file coeffs.py", "plug-in plug.py"]


def test_symtop_itself_and_libraries_count_by_themselves(tmp_path):
    """A plug-in may lie above a checkout or an environment."""
    (tmp_path / "symtop").symlink_to(plugins.fingerprint.roots["symtop"])
    packages = tmp_path / "env" / "site-packages"
    packages.mkdir(parents=True)
    (packages / "library.py").write_text("W = (0.5, 0.5)\n")
    text = HERE.format(more=" / 'env' / 'site-packages'") + "from library import W\n" + REGISTER.format(name="above")
    assert list(made_of(write(tmp_path, plug=text))) == ["plug-in plug.py"]


def test_two_plugins_of_one_name_are_told_apart(tmp_path):
    names = []
    for k in (1, 2):
        text = f"W = (0.5, 0.5)\n{REGISTER.format(name=f'plug-files-{k}')}"
        names.append(plugins.load(write(tmp_path / str(k), plug=text)))
    assert names == [["plug-files-1"], ["plug-files-2"]]
    first, second = (plugins.reasons(name) for name in names)
    assert first.keys() == second.keys() == {"plug-in plug.py"}
    assert first != second
    both = plugins.reasons(["plug-files-1", "plug-files-2"])
    assert both["plug-in plug.py"] not in (*first.values(), *second.values())


def test_a_mistake_in_a_plugin_is_told_with_its_name_and_as_no_option_of_the_command(tmp_path):
    text = "import symtop\nsymtop.Integrator(name='m', family='other', summary='', solvers={'angles': print}, {})\n"
    plugin = write(tmp_path, plug=text.replace("{})", "symplectic='yes')"))
    done = CliRunner().invoke(main, ["integrators", "--plugin", str(plugin)])
    assert (done.exit_code, done.output) == (
        2, "symtop: plugin plug.py: symplectic must be True, False or None, not 'yes'\n"
    )  # fmt: skip
