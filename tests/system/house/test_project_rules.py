"""The rules of the house that a reader can count on, checked in the sources themselves."""

import ast
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from programs import ROOT

PACKAGES = ("library", "stream", "tools")
#: The imports of a package: itself and these.
BELOW = {"library": set[str](), "stream": {"library"}, "tools": {"library", "stream"}}
#: Folders and files that do no input or output, and know no clock and no thread.
CORE = ("library", "stream/recognizer", "stream/frame.py", "stream/recognition.py")
CORE += ("stream/osc/packet.py", "stream/osc/messages.py", "stream/outputs/layouts.py")
CORE += ("stream/zeromq/messages.py",)
CORE += (
    "stream/inputs/decoder.py",
    "stream/inputs/detection.py",
    "stream/packet.py",
    "stream/inputs/takes.py",
)
CORE += tuple(
    f"stream/feeds/{name}.py"
    for name in (
        "frame_assembler",
        "kinematics",
        "message_reader",
        "preset",
    )
)
NOT_IN_CORE = {"socket", "time", "threading", "zmq", "asyncio", "selectors", "multiprocessing", "logging"}
#: The folders in which people keep their work; no source says where it was written.
MACHINE_FOLDERS = tuple(f"/{name}/" for name in ("home", "root", "work", "Users"))
TEXT = {".py", ".md", ".toml", ".txt", ".yml", ".yaml", ".cfg", ".svg", ".sh", ".csv", ""}

RECORDINGS = (".amc", ".asf", ".c3d", ".bvh", ".trc", ".fbx")
#: Bytes above which a recording is none of a test's examples.
MAX_EXAMPLE = 20_000

SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def name_of(path: Path) -> str:
    """Name a source from the project's root."""
    return str(path.relative_to(ROOT))


def package_of(path: Path) -> str:
    """Give the top package a source belongs to."""
    return path.relative_to(ROOT).parts[0]


CORE_SOURCES = [path for path in SOURCES if any(path.is_relative_to(ROOT / place) for place in CORE)]


@cache
def parsed(path: Path) -> ast.Module:
    """Parse a source, once for all rules."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imported(path: Path) -> set[str]:
    """Give the packages a source imports, anywhere in it and for type checking too: ours by folder, others by name."""
    names: set[str] = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module or package_of(path))
    return {name.removeprefix("kinespace.").partition(".")[0] for name in names}


def called(path: Path) -> set[str]:
    """Give the names of the functions a source calls."""
    calls = [node.func for node in ast.walk(parsed(path)) if isinstance(node, ast.Call)]
    return {call.id for call in calls if isinstance(call, ast.Name)}


def project_files() -> list[Path]:
    """List the files that are, or are about to be, part of the project."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout")
    command = [git, "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60)
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def test_no_recording_and_no_large_file_is_kept() -> None:
    """Only the built-in library and everyday movement are large; no recording is larger than a test's example."""
    sizes = {path: path.stat().st_size for path in project_files()}
    assert {path.name for path, size in sizes.items() if size > 300_000} == {"hdm05.npz", "everyday.npz"}
    assert [path for path, size in sizes.items() if path.suffix.lower() in RECORDINGS and size > MAX_EXAMPLE] == []


def test_imports_go_one_way() -> None:
    """Tools know stream and library, stream knows library, library knows neither."""
    for path in SOURCES:
        package = package_of(path)
        assert imported(path) & set(PACKAGES) <= BELOW[package] | {package}, name_of(path)


def test_folders_import_one_way() -> None:
    """No two folders of a package import each other, nor do several in a circle, not even for the types."""
    left = {folder: below - {folder} for folder, below in _folders_imported().items()}
    while free := [folder for folder, below in left.items() if not below & left.keys()]:
        for folder in free:
            del left[folder]
    assert not left, "these folders import each other in a circle, or import folders that do"


def _folders_imported() -> dict[str, set[str]]:
    """Give for each folder in a package the folders that its files import; a folder's face is its package's."""
    folders = {".".join(path.relative_to(ROOT).parts[:2]) for path in SOURCES if len(path.relative_to(ROOT).parts) > 2}
    imported_by: dict[str, set[str]] = {folder: set() for folder in folders}
    for path in SOURCES:
        folder = ".".join(path.relative_to(ROOT).parts[:2])
        if folder not in folders:
            continue
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.ImportFrom) and node.module:
                parts = node.module.removeprefix("kinespace.").split(".")
                named = [".".join([*parts, alias.name][:2]) for alias in node.names]
                imported_by[folder] |= {each for each in named if each in folders}
    return imported_by


def test_the_core_does_no_input_or_output() -> None:
    """The recogniser and its parts import no socket, clock, thread or transport, and print nothing."""
    for path in CORE_SOURCES:
        assert not imported(path) & NOT_IN_CORE, name_of(path)
        never = {"print", "input"} | ({"open"} if package_of(path) == "stream" else set())
        assert not called(path) & never, name_of(path)


def test_the_core_is_loaded_without_transports() -> None:
    """Importing the recogniser and the library, as the README does, loads no transport, no terminal and no scipy."""
    others = "{'zmq', 'pythonosc', 'rich', 'matplotlib', 'scipy'}"
    code = f"import sys, kinespace.library, kinespace.stream; print(sorted({others} & set(sys.modules)))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "[]\n"


def test_no_source_says_where_it_was_written() -> None:
    """No text file of the project contains an absolute path of a person's machine."""
    said = []
    for path in project_files():
        if path.suffix in TEXT:
            text = path.read_text(encoding="utf-8")
            said += [
                f"{name_of(path)}: {folder}" for folder in MACHINE_FOLDERS if re.search(rf"(?<![\w.]){folder}", text)
            ]
    assert said == []
