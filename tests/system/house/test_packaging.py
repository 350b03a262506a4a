"""The package: its modules, their data, and a built-in library made by our own command."""

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from programs import ROOT

from kinespace.library import MotionLibrary
from kinespace.library.naming import hdm05

#: Each folder that is shipped, and the name it is imported by.
FOLDERS = {"tools/front": "kinespace"} | {
    path.parent.relative_to(ROOT).as_posix(): f"kinespace.{path.parent.relative_to(ROOT).as_posix().replace('/', '.')}"
    for top in ("library", "stream", "tools")
    for path in sorted((ROOT / top).rglob("__init__.py"))
    if path.parent != ROOT / "tools" / "front"
}

#: Folders of files without modules of the product, which count as packages, too.
FILES = {
    f"kinespace.{folder.replace('/', '.')}": folder
    for folder in (
        "library/naming/conventions",
        "stream/feeds/presets",
        "tools/examples",
        "tools/examples/processing",
        "tools/examples/unity",
        "tools/examples/unity/Runtime",
        "tools/page/static",
    )
}


def project() -> dict[str, dict[str, Any]]:
    """Read pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def package_folder(path: Path) -> Path:
    """Find the folder of the package that a file belongs to, as its module or as its data."""
    files = {ROOT / folder for folder in FILES.values()}
    return next(folder for folder in path.parents if folder in files or (folder / "__init__.py").exists())


def test_exactly_the_packages_there_are_are_shipped() -> None:
    """The packages are named one by one, and they are all the packages the sources have beside the tests."""
    setuptools = project()["tool"]["setuptools"]
    assert sorted(setuptools["packages"]) == sorted([*FOLDERS.values(), *FILES])
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
        top, _, below = FILES[package].partition("/") if package in FILES else ("", "", "")
        with resources.as_file(resources.files(f"kinespace.{top}" if top else package)) as folder:
            found = list((folder / below).glob(name))
            assert found
            assert name == "py.typed" or all(path.read_bytes() for path in found)


def test_every_file_in_a_package_is_declared() -> None:
    """No file lies in a package that is neither Python nor declared as its data: it would be missing from the wheel."""
    declared_by = project()["tool"]["setuptools"]["package-data"]
    for package, folder in ({package: folder for folder, package in FOLDERS.items()} | FILES).items():
        declared = {path for each in declared_by.get(package, []) for path in (ROOT / folder).glob(each)}
        within = [path for path in (ROOT / folder).rglob("*") if path.is_file()]
        within = [path for path in within if not {"__pycache__", "node_modules"} & {*path.parts}]
        own = {path for path in within if package_folder(path) == ROOT / folder}
        assert {path for path in own if path.suffix not in (".py", ".so", ".pyd", ".c", ".h")} <= declared <= own


def test_compiled_modules_are_optional() -> None:
    """The compiled loops are optional and serve every Python from 3.11 on; all their sources are in the project."""
    build = (ROOT / "setup.py").read_text(encoding="utf-8")
    assert "optional=True" in build
    assert "py_limited_api=True" in build
    assert '"py_limited_api": "cp311"' in build
    assert '"library/compiled/loops.c"' in build
    assert '#include "' not in (ROOT / "library/compiled/loops.c").read_text("utf-8")


@pytest.mark.slow
def test_a_wheel_is_built_in_silence_and_afresh(tmp_path: Path) -> None:
    """The build of a wheel warns of nothing, and loops of an earlier build are not put into a wheel without them."""
    sources = tmp_path / "sources"
    kept = ("library", "stream", "tools", "pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE")
    sources.mkdir()
    for name in kept:
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy2)(ROOT / name, sources / name)
    options = ("--no-deps", "--no-build-isolation", "--wheel-dir", str(tmp_path))
    command = [sys.executable, "-W", "error", "-m", "pip", "wheel", *options, "."]
    # The compiler need not take the time to make the loops fast.
    compiler = tmp_path / "cc"
    compiler.write_text('#!/bin/sh\nexec cc "$@" -O0\n', encoding="utf-8")
    compiler.chmod(0o755)
    quick = {} if sys.platform == "win32" or not shutil.which("cc") else {"CC": str(compiler)}
    held = []
    for environment in (quick, {"CC": "false"}):
        done = subprocess.run(
            command, cwd=sources, env=os.environ | environment, capture_output=True, text=True, check=False, timeout=300
        )
        assert done.returncode == 0, done.stderr
        assert "Warning:" not in done.stdout + done.stderr
        with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
            held.append([name for name in wheel.namelist() if name.endswith((".so", ".pyd"))])
            assert "kinespace/tools/examples/squat.txt" in wheel.namelist()
    assert held[1] == []
    assert held[0] or not quick


def test_the_librarys_terms_stand_beside_it() -> None:
    """The licence beside the built-in library names its terms and whom to name, and so does the library itself."""
    text = " ".join((resources.files("kinespace.library") / "LICENSE-hdm05.txt").read_text(encoding="utf-8").split())
    assert "CC BY-SA 3.0" in text or "Attribution-ShareAlike 3.0" in text
    assert "HDM05" in text
    assert "Mueller" in text
    library = MotionLibrary.builtin()
    assert {(each.licence, each.attribution) for each in library.motions} == {(hdm05.LICENCE, hdm05.ATTRIBUTION)}
    licence = project()["project"]["license"]
    assert licence == "MIT AND CC-BY-SA-3.0"
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
