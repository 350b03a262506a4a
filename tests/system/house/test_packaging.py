"""The package: its modules, their data, and a built-in library made by our own command."""

import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from programs import ROOT

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


def test_every_file_in_a_package_is_declared() -> None:
    """No file lies in a package that is neither Python nor declared as its data: it would be missing from the wheel."""
    declared_by = project()["tool"]["setuptools"]["package-data"]
    for package, folder in ({package: folder for folder, package in FOLDERS.items()} | FILES).items():
        declared = {path for each in declared_by.get(package, []) for path in (ROOT / folder).glob(each)}
        within = [path for path in (ROOT / folder).rglob("*") if path.is_file()]
        within = [path for path in within if not {"__pycache__", "node_modules"} & {*path.parts}]
        own = {path for path in within if package_folder(path) == ROOT / folder}
        assert {path for path in own if path.suffix not in (".py", ".so", ".pyd", ".c", ".h")} <= declared <= own


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
