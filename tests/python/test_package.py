"""The package: light to import, typed, and with stubs that tell the truth."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from conftest import in_python

import isolux


def test_importing_pulls_in_numpy_and_nothing_else():
    """Catches h5py, typer, rich, trimesh or another package in the way of a script's first line."""
    code = (
        "import sys, json; before = set(sys.modules); import isolux;"
        "names = {name.partition('.')[0] for name in set(sys.modules) - before};"
        "print(json.dumps(sorted(names - set(sys.stdlib_module_names))))"
    )
    assert json.loads(in_python(code).stdout) == ["isolux", "numpy"]


def test_solving_pulls_in_nothing_more():
    """Catches a package that the path from a file to an answer needs."""
    code = """
import sys; sys.path.insert(0, sys.argv[1])
import numpy; before = set(sys.modules)
import isolux
scene = isolux.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 0, -1]], [[0, 1, 2]], [{"emission": 1.0}])
isolux.solve(scene, error=0.5).radiosity_at([0], [[1, 0, 0]])
names = {name.partition('.')[0] for name in set(sys.modules) - before}
print(sorted(names - set(sys.stdlib_module_names)))
"""
    assert in_python(code, Path(__file__).parent).stdout == "['isolux']\n"


def test_public_names_exist_and_have_words():
    """Catches a name that is promised and missing, or without a docstring."""
    for name in isolux.__all__:
        value = getattr(isolux, name)
        assert name == "__version__" or value.__doc__, name
    assert Path(isolux.__file__).with_name("py.typed").exists()


def test_stubs_agree_with_the_extension():
    """Catches a function, argument or default that differs between the extension and its stub."""
    command = [sys.executable, "-m", "mypy.stubtest", "isolux._isolux"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_reports_have_the_fields_of_the_solver():
    """Catches a field that the solver reports and Python drops, or the other way round."""
    scene = isolux.Scene.from_arrays([[0, 0, 0], [1, 0, 0], [0, 0, -1]], [[0, 1, 2]], [{"emission": 1.0}])
    solution = isolux.solve(scene, error=0.5)
    assert solution.report.to_dict() == json.loads(solution._inner.report)
