"""The package: its modules, their data, and a built-in library made by our own command."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib import resources
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import pytest
from programs import ROOT

from kinespace.library import MotionLibrary
from kinespace.library.naming import hdm05

if TYPE_CHECKING:
    from pathlib import Path

#: Each folder that is shipped, and the name it is imported by.
FOLDERS = {"tools/front": "kinespace"} | {
    path.parent.relative_to(ROOT).as_posix(): f"kinespace.{path.parent.relative_to(ROOT).as_posix().replace('/', '.')}"
    for top in ("library", "stream", "tools")
    for path in sorted((ROOT / top).rglob("__init__.py"))
    if path.parent != ROOT / "tools" / "front"
}


def project() -> dict[str, dict[str, Any]]:
    """Read pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def package_folder(path: Path) -> Path:
    """Find the folder of the package that a file belongs to, as its module or as its data."""
    return next(folder for folder in path.parents if (folder / "__init__.py").exists())


def test_exactly_the_packages_there_are_are_shipped() -> None:
    """The packages are named one by one, and they are all the packages the sources have beside the tests."""
    setuptools = project()["tool"]["setuptools"]
    assert sorted(setuptools["packages"]) == sorted(FOLDERS.values())
    assert len(FOLDERS) > 10
    assert {find_spec(package).origin for package in FOLDERS.values()} == {  # type: ignore[union-attr]
        str(ROOT / folder / "__init__.py") for folder in FOLDERS
    }


def test_declared_data_files_exist() -> None:
    """Every data file that is declared can be found the way an installed package finds it, and is not empty."""
    setuptools = project()["tool"]["setuptools"]
    declared = {(package, name) for package, names in setuptools["package-data"].items() for name in names}
    assert declared >= {("kinespace.library", "hdm05.npz"), ("kinespace.library", "LICENSE-hdm05.txt")}
    assert ("kinespace", "py.typed") in declared
    for package, name in declared:
        with resources.as_file(resources.files(package)) as folder:
            found = list(folder.glob(name))
            assert found
            assert name == "py.typed" or all(path.read_bytes() for path in found)


def test_every_file_in_a_package_is_declared() -> None:
    """No file lies in a package that is neither Python nor declared as its data: it would be missing from the wheel."""
    setuptools = project()["tool"]["setuptools"]
    modules = setuptools["ext-modules"]
    sources = {name for module in modules for name in (*module["sources"], *module["depends"])}
    for folder, package in FOLDERS.items():
        globs = setuptools["package-data"].get(package, [])
        declared = {path for each in globs for path in (ROOT / folder).glob(each)}
        within = [path for path in (ROOT / folder).rglob("*") if path.is_file() and "__pycache__" not in path.parts]
        # Programs to be copied are in the source archive alone.
        within = [path for path in within if not path.is_relative_to(ROOT / "tools" / "examples")]
        own = {path for path in within if package_folder(path) == ROOT / folder}
        others = {path for path in own if path.suffix not in (".py", ".so", ".pyd")}
        assert {path for path in others if path.relative_to(ROOT).as_posix() not in sources} == declared


def test_compiled_modules_are_optional() -> None:
    """Compiled modules are optional and serve every Python from 3.11 on; all their sources are in the project."""
    setuptools = project()["tool"]["setuptools"]
    distutils = project()["tool"]["distutils"]
    for module in setuptools["ext-modules"]:
        assert module["optional"] is True
        assert module["py-limited-api"] is True
        included = re.findall(r'^#include "(.+)"$', (ROOT / module["sources"][0]).read_text("utf-8"), re.MULTILINE)
        assert {f"library/kernels/{name}" for name in included} == set(module["depends"])
    assert distutils["bdist_wheel"]["py-limited-api"] == "cp311"


def test_the_librarys_terms_stand_beside_it() -> None:
    """The licence beside the built-in library names its terms and whom to name, and so does the library itself."""
    text = " ".join((resources.files("kinespace.library") / "LICENSE-hdm05.txt").read_text(encoding="utf-8").split())
    assert "CC BY-SA 3.0" in text or "Attribution-ShareAlike 3.0" in text
    assert "HDM05" in text
    assert "Mueller" in text
    assert "UI-PRMD" in text
    assert "Open Data Commons Public Domain Dedication" in text
    library = MotionLibrary.builtin()
    assert {(each.licence, each.attribution) for each in library.motions} == {(hdm05.LICENCE, hdm05.ATTRIBUTION)}
    assert all(each.licence == "ODC PDDL 1.0" and "Vakanski" in each.attribution for each in library.guests)
    licence = project()["project"]["license"]
    assert licence == "MIT AND CC-BY-SA-3.0 AND PDDL-1.0"
    assert project()["project"]["license-files"] == ["LICENSE", "library/LICENSE-hdm05.txt"]


def test_a_python_that_is_promised_is_one_that_is_required() -> None:
    """The lowest Python among the classifiers is the one that is required."""
    described = project()["project"]
    prefix = "Programming Language :: Python :: 3."
    promised = [int(each.removeprefix(prefix)) for each in described["classifiers"] if each.startswith(prefix)]
    assert described["requires-python"] == f">=3.{min(promised)}"


@pytest.mark.slow
def test_modules_of_the_user_do_not_interfere(tmp_path: Path) -> None:
    """A script beside a `stream.py` and folders `library` and `tools` of its own imports ours and its own."""
    (tmp_path / "stream.py").write_text("MINE = True\n", encoding="utf-8")
    for folder in ("library", "tools"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text("MINE = True\n", encoding="utf-8")
    script = tmp_path / "script.py"
    script.write_text(
        "import library, stream, tools\n"
        "from kinespace.library import Clip, MotionLibrary, Skeleton\n"
        "from kinespace.stream import Frame, Recognizer, Settings\n"
        "import kinespace.tools.cli.main\n"
        "assert library.MINE and stream.MINE and tools.MINE\n"
        "print(len(MotionLibrary.builtin()))\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, str(script)], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) > 200
