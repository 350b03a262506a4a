"""The rules of the house that a reader can count on, checked in the sources themselves."""

import ast
import os
import re
import shutil
import subprocess
import tomllib
from collections import Counter
from collections.abc import Mapping
from functools import cache
from graphlib import TopologicalSorter
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_args

import figures
import pytest
from programs import ROOT, python, ran

import kinespace.library
import kinespace.stream
from kinespace.stream.outputs.sink import Message
from kinespace.tools.cli.main import EXPERIMENTS, PROGRAMS

PACKAGES = ("library", "stream", "tools")
#: The imports of a package: itself and these.
BELOW = {"library": set[str](), "stream": {"library"}, "tools": {"library", "stream"}}
#: Folders and files that do no input or output, and know no clock and no thread.
CORE = (
    *("library", "stream/recognizer", "stream/frame.py", "stream/recognition.py", "stream/packet.py"),
    *("stream/osc/packet.py", "stream/osc/messages.py", "stream/outputs/layouts.py", "stream/zeromq/messages.py"),
    *(f"stream/inputs/{name}.py" for name in ("decoder", "detection", "takes")),
    *(f"stream/feeds/{name}.py" for name in ("frame_assembler", "kinematics", "message_reader", "preset")),
)
NOT_IN_CORE = {"socket", "time", "threading", "zmq", "asyncio", "selectors", "multiprocessing", "logging"}
#: The folders in which people keep their work; no source says where it was written.
MACHINE_FOLDERS = tuple(f"/{name}/" for name in ("home", "root", "work", "Users"))
TEXT = {".py", ".md", ".toml", ".txt", ".yml", ".yaml", ".cfg", ".svg", ".sh", ".csv", ""}

RECORDINGS = (".amc", ".asf", ".c3d", ".bvh", ".trc", ".fbx")
#: Bytes above which a recording is none of a test's examples.
MAX_EXAMPLE = 20_000

#: Programs that tests run, by name.
RECIPES = tomllib.loads(Path(__file__).with_name("recipes.toml").read_text(encoding="utf-8"))
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
def imports(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """List what a source imports, anywhere in it and for type checking too."""
    return [node for node in ast.walk(parsed(path)) if isinstance(node, ast.Import | ast.ImportFrom)]


@cache
def imported(path: Path) -> set[str]:
    """Give the packages a source imports: ours by folder, others by name."""
    names: set[str] = set()
    for node in imports(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        else:
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


def test_a_class_name_stands_for_one_thing() -> None:
    """The page's `Classes`, `Done` and `Event` are the recogniser's off the wire; a `Bone` is a file's or a feed's."""
    names = Counter(
        node.name.lstrip("_") for path in SOURCES for node in ast.walk(parsed(path)) if isinstance(node, ast.ClassDef)
    )
    assert {name for name, count in names.items() if count > 1} <= {"Bone", "Classes", "Done", "Event"}


def test_folders_import_one_way() -> None:
    """No two folders of a package import each other, nor do several in a circle, not even for the types."""
    # Its error names the circle.
    TopologicalSorter({folder: below - {folder} for folder, below in _folders_imported().items()}).prepare()


def _folders_imported() -> dict[str, set[str]]:
    """Give for each folder in a package the folders that its files import; a folder's face is its package's."""
    folders = {".".join(path.relative_to(ROOT).parts[:2]) for path in SOURCES if len(path.relative_to(ROOT).parts) > 2}
    imported_by: dict[str, set[str]] = {folder: set() for folder in folders}
    for path in SOURCES:
        folder = ".".join(path.relative_to(ROOT).parts[:2])
        if folder not in folders:
            continue
        for node in imports(path):
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


def test_a_sink_takes_messages_that_there_are() -> None:
    """A sink's method is found by its message's class: a method of another name would never be called."""
    known = {f"publish_{each.__name__.lower()}" for each in get_args(Message)}
    sinks = "\n".join(text for text in map(Path.read_text, SOURCES) if "(Sink):" in text)
    assert set(re.findall(r"(publish_\w+)(?:\(self, \w+: | = publish_)", sinks)) == known


@pytest.mark.parametrize(
    ("modules", "others"),
    [
        ("kinespace.library, kinespace.stream", {"zmq", "pythonosc", "rich", "matplotlib", "scipy"}),
        ("kinespace.tools.programs.live", {"asyncio", "websockets", "matplotlib"}),
    ],
)
def test_a_module_is_loaded_without_others(modules: str, others: set[str]) -> None:
    """The recogniser and the library need no transport, no terminal and no scipy; a program's start no asyncio."""
    code = f"import sys, {modules}; print(sorted({others} & set(sys.modules)))"
    assert python("-c", code, cwd=ROOT).stdout == "[]\n"


def test_no_source_says_where_it_was_written() -> None:
    """No text file of the project contains an absolute path of a person's machine."""
    said = []
    for path in project_files():
        if path.suffix in TEXT:
            found = re.findall(rf"(?<![\w.])(?:{'|'.join(MACHINE_FOLDERS)})", path.read_text(encoding="utf-8"))
            said += [f"{name_of(path)}: {folder}" for folder in found]
    assert said == []


def test_a_program_asks_no_network() -> None:
    """The programs that tests start refuse the same."""
    assert python("-c", RECIPES["network"]["uses"]).stdout.strip() == str([True] * 9)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", figures.QUICK)
def test_no_figure_falls(name: str, request: pytest.FixtureRequest) -> None:
    """Each new figure is within its tolerance of the expected one, or better."""
    line, entries = figures.RUNS[name], figures.expected()[name]
    data = request.getfixturevalue("data_folder") if "{data}" in line else None
    worse = figures.fallen(name, entries, figures.measured(line, entries, data))
    assert not worse, "\n".join(worse)


@pytest.mark.slow
def test_every_evaluation_has_figures() -> None:
    """Each run has some; at least one run is of each experiment."""
    assert all(figures.expected().values())
    assert {line.split()[0] for line in figures.RUNS.values()} == set(EXPERIMENTS)


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_has_every_page_and_name(tmp_path: Path) -> None:
    """Mkdocs takes warnings for errors; each page is in its list, and each public name has an entry."""
    # griffe, which reads the sources, looks for packages by folder, as mypy does.
    packages = ROOT / ".venv" / "packages" / "kinespace"
    packages.mkdir(parents=True, exist_ok=True)
    for room in ("library", "stream", "tools"):
        link = packages / room
        if not link.exists():
            link.symlink_to(ROOT / room)
    settings, environment = ROOT / ".ci" / "mkdocs.yml", {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = python("-m", "mkdocs", "build", "--quiet", "-f", settings, "-d", tmp_path, env=environment)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    pages = {page.stem for page in (tmp_path / "docs").glob("*.html")}
    assert pages == {page.stem for page in (ROOT / ".github" / "docs").glob("*.md")}
    front, api = ((tmp_path / page).read_text(encoding="utf-8") for page in ("index.html", "docs/api.html"))
    for page in pages:
        assert f'href="docs/{page}.html"' in front
    for package in (kinespace.library, kinespace.stream):
        # A constant has a comment, no docstring.
        for name in (each for each in package.__all__ if not each.isupper()):
            assert f'id="{package.__name__}.{name}"' in api


#: The text of each page, by its path.
PAGES = {
    path: path.read_text(encoding="utf-8")
    for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / ".github" / "docs").glob("*.md")))
}
README = PAGES[ROOT / "README.md"]
ALL = "\n".join(PAGES.values())
_FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
FENCED = _FENCE.findall(ALL)
PYTHON = [code for language, code in FENCED if language == "python"]
#: Lines of fenced blocks, and code spans: where commands stand. Docker's options are Docker's.
CODE = [line for _, code in FENCED for line in code.splitlines() if not line.startswith("docker")]
CODE += re.findall(r"`([^`\n]+)`", _FENCE.sub("", ALL))
#: Each command of ours, without the name of the program that it begins with.
COMMANDS = re.findall(r"(?:^|(?<!from)[ /])kinespace +([a-z][^#&|>\n]*)", "\n".join(CODE), re.MULTILINE)
ALL_PROGRAMS = [*PROGRAMS, *(f"evaluate {name}" for name in EXPERIMENTS)]


@cache
def options_of(program: str) -> set[str]:
    """Ask a program which options it has."""
    return set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", ran(*program.split(), "--help")[1]))


@pytest.mark.slow
def test_every_python_example_runs(tmp_path: Path) -> None:
    """Each example in Python runs with names of its own, in any folder, without a warning, and prints something.

    Of the built-in library they get some motions: most examples open it anew, without a motion.
    """
    done = python("-W", "error", "-c", RECIPES["examples"]["uses"], *PYTHON, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert all(printed.strip() for printed in done.stdout.split("=====\n")[: len(PYTHON)])


@pytest.mark.skipif(not (ROOT / ".venv/packages").exists(), reason="make types lays the packages out")
@pytest.mark.slow
def test_every_python_example_passes_a_strict_type_checker(tmp_path: Path) -> None:
    """Types say as much as the docstrings: texts for signatures, lists for arrays and names."""
    for number, code in enumerate([*PYTHON, RECIPES["types"]["uses"]]):
        (tmp_path / f"example{number}.py").write_text(code, encoding="utf-8")
    # By the settings of `make types`, so that what it has learned of our modules need not be learned again.
    checked = python("-m", "mypy", *sorted(tmp_path.glob("*.py")), cwd=ROOT)
    said = [line for line in checked.stdout.splitlines() if "/example" in line and "[import-" not in line]
    assert "\n".join(said) == checked.stderr == ""


def test_every_command_shown_exists() -> None:
    """Each command on a page names a program there is, with options it has."""
    for line in COMMANDS:
        command = line.split()
        program = " ".join(command[:2]) if command[0] == "evaluate" else command[0]
        used = {word.partition("=")[0] for word in command if re.match(r"--?[a-z]", word)}
        assert program in ALL_PROGRAMS, line
        assert used <= options_of(program), line


def test_every_program_with_json_has_a_row_on_its_page() -> None:
    """The rows are those of the programs that take `--json`; `test_experiments` compares the evaluations' keys."""
    rows = re.findall(r"^\| `([a-z ]+)`", PAGES[ROOT / ".github/docs/json.md"], re.MULTILINE)
    assert set(rows) == {each for each in ALL_PROGRAMS if "--json" in options_of(each)}


def anchors(text: str) -> set[str]:
    """Give the anchors of a page's headings."""
    headings = re.findall(r"^#+ (.+)$", _FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_link_within_the_project_leads_somewhere(page: Path) -> None:
    """Each relative link or picture is a file of the project, each anchor one of that page's headings."""
    for link in re.findall(r"\]\(([^)\s]+)\)", _FENCE.sub("", PAGES[page])):
        if "://" in link or link.startswith("mailto:"):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(PAGES[target]), link


def test_the_readme_is_read_in_minutes() -> None:
    """README has few lines, none of them long; it says how the tests are run."""
    lines = README.splitlines()
    assert len(lines) <= 90
    assert max(map(len, lines)) <= 110
    assert any(line.startswith("make test ") for line in lines)


def test_every_test_that_a_page_cites_is_there() -> None:
    """A page says which tests hold a promise: files of these names exist."""
    cited = {name for text in PAGES.values() for name in re.findall(r"\btest_\w+\.py\b", text)}
    assert len(cited) > 12
    assert cited <= {path.name for path in (ROOT / "tests").rglob("test_*.py")}


def test_the_pages_stay_short() -> None:
    """All pages together, the method's, which is read beside the code, and the one on strangers."""
    words = {path.name: len(text.split()) for path, text in PAGES.items() if path.is_relative_to(ROOT / ".github")}
    assert sum(words.values()) <= 14_000
    assert words["method.md"] <= 1_000
    assert words["robustness.md"] <= 1_800


def shipped() -> dict[str, Path]:
    """Give each folder of the packages by the name it is imported by; folders of files count as packages, too."""
    tops = [ROOT / package for package in PACKAGES]
    folders = [each for top in tops for each in (top, *top.rglob("*")) if each.is_dir() and not _is_made(each)]
    named = {f"kinespace.{name_of(folder).replace('/', '.')}": folder for folder in folders}
    return {name.replace("kinespace.tools.front", "kinespace"): folder for name, folder in named.items()}


def _is_made(path: Path) -> bool:
    return bool({"__pycache__", "node_modules"} & {*path.parts})


def setup() -> dict[str, Any]:
    """Read what pyproject.toml tells setuptools."""
    told: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    return told


def test_exactly_the_packages_there_are_are_shipped() -> None:
    """The packages are named one by one, and they are all the packages the sources have beside the tests."""
    assert sorted(setup()["packages"]) == sorted(shipped())
    modules = {name: folder / "__init__.py" for name, folder in shipped().items() if (folder / "__init__.py").exists()}
    assert len(modules) > 10
    assert {name: find_spec(name).origin for name in modules} == {  # type: ignore[union-attr]
        name: str(path) for name, path in modules.items()
    }


def test_every_file_in_a_package_is_declared() -> None:
    """No file lies in a package that is neither Python nor declared as its data: it would be missing from the wheel."""
    for package, folder in shipped().items():
        declared = {path for each in setup()["package-data"].get(package, []) for path in folder.glob(each)}
        own = {path for path in folder.iterdir() if path.is_file()}
        assert {path for path in own if path.suffix not in (".py", ".so", ".pyd", ".c", ".h")} <= declared <= own


# --- what CONTRIBUTING says of adding things, done in a copy of the program -------------------------------------------


def _changed(folder: Path, edits: Mapping[str, Mapping[str, str]]) -> None:
    """Copy the program into a folder, and change some of its texts."""
    for room in ("library", "stream", "tools"):
        shutil.copytree(ROOT / room, folder / "kinespace" / room, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "tools" / "front" / "__init__.py", folder / "kinespace")
    for name, changes in edits.items():
        path = folder / "kinespace" / name
        text = path.read_text(encoding="utf-8")
        for before, after in changes.items():
            assert text.count(before) == 1, before
            text = text.replace(before, after)
        path.write_text(text, encoding="utf-8")


def _run(folder: Path, script: str) -> str:
    environment = dict(os.environ, PYTHONPATH=str(folder), PYTHONDONTWRITEBYTECODE="1")
    done = python("-c", script, cwd=folder, env=environment)
    assert not done.returncode, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_part_of_the_signature_is_added_in_one_file(tmp_path: Path) -> None:
    """It is read off a live window and off the library's alike, learned, and compared."""
    _changed(tmp_path, RECIPES["part"]["edits"])
    assert re.fullmatch("squat1Reps|clap5Reps", _run(tmp_path, RECIPES["part"]["uses"]).strip())


@pytest.mark.slow
def test_a_message_is_added_in_five_files(tmp_path: Path) -> None:
    """As a value, in each transport, in the layouts, and where the service says it."""
    assert len(RECIPES["message"]["edits"]) == 5
    _changed(tmp_path, RECIPES["message"]["edits"])
    _run(tmp_path, RECIPES["message"]["uses"])
