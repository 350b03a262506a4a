"""README and its pages: their examples run, and their links and options exist."""

import os
import pydoc
import re
import subprocess
import sys
from fractions import Fraction
from itertools import compress
from pathlib import Path

import pytest
from programs import ROOT

import kinespace
from kinespace.library.signature.parts import Kind
from kinespace.library.windows.comparison import ACROSS_LABORATORIES, WITHIN_LABORATORY
from kinespace.tools.cli.main import EXPERIMENTS, PROGRAMS, main

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


def options_of(program: str, capsys: pytest.CaptureFixture[str]) -> set[str]:
    """Ask a program which options it has."""
    with pytest.raises(SystemExit):
        main([*program.split(), "--help"])
    return set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", capsys.readouterr().out))


def test_there_is_something_to_run() -> None:
    """The pages show at least one example in Python and one command."""
    assert PYTHON
    assert COMMANDS


@pytest.mark.slow
@pytest.mark.parametrize("code", PYTHON)
def test_every_python_example_runs(code: str, tmp_path: Path) -> None:
    """Each example in Python runs by itself, in any folder, without a warning, and prints something."""
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip()


@pytest.mark.slow
def test_every_python_example_passes_a_strict_type_checker(tmp_path: Path) -> None:
    """Types say as much as the docstrings: texts for signatures, lists for arrays and names."""
    further = """
from kinespace import Announcement, Frame, MotionClassifier, MotionLibrary, Settings, Skeleton, read_recordings

clips = list(read_recordings("folder", actor_in="name"))
skeleton = Skeleton(["a", "b"])
frame, joints = Frame("ann", 0.0, [[0.0, 0.0, 0.0]] * 31), Announcement("ann", ["root", "head"])
named = MotionClassifier(skeleton).fit(clips, [clip.class_name for clip in clips]).predict([[[[0.0] * 3] * 2] * 9])
paper, library = Settings(signature="paper"), MotionLibrary.of_clips(clips)
"""
    for number, code in enumerate([*PYTHON, further]):
        (tmp_path / f"example{number}.py").write_text(code, encoding="utf-8")
    (tmp_path / "kinespace").symlink_to(ROOT / ".venv/packages/kinespace")
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", *sorted(map(str, tmp_path.glob("*.py")))]
    command += [
        "--cache-dir",
        str(tmp_path / "cache"),
        "--ignore-missing-imports",
        "--disable-error-code=import-untyped",
    ]
    environment = {**os.environ, "MYPYPATH": str(tmp_path)}
    checked = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "\n".join(line for line in checked.stdout.splitlines() if line.startswith("example")) == ""


def test_the_package_offers_the_names_of_the_readme() -> None:
    """From `kinespace` itself, with a version; `help` fits two screens of forty lines."""
    shown = pydoc.plain(pydoc.render_doc(kinespace))
    assert shown.count("\n") <= 80
    for name in ("Clip", "Frame", "MotionLibrary", "Performers", "Recognizer", "Settings", "read_recordings"):
        assert getattr(kinespace, name).__name__ == name
        assert name in dir(kinespace)
        assert name in shown
    assert kinespace.__version__
    assert kinespace.stream.Recognizer is kinespace.Recognizer
    with pytest.raises(AttributeError, match="module 'kinespace' has no attribute 'Recogniser'"):
        _ = kinespace.Recogniser  # type: ignore[attr-defined]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_shown_exists(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each command on a page names a program there is, with options it has."""
    command = line.split()
    program = " ".join(command[:2]) if command[0] == "evaluate" else command[0]
    assert command[0] in PROGRAMS
    used = {word.partition("=")[0] for word in command if re.match(r"--?[a-z]", word)}
    assert used <= options_of(program, capsys)


def test_every_option_named_alone_exists(capsys: pytest.CaptureFixture[str]) -> None:
    """Each option that stands on a page without its command belongs to some program."""
    known = set().union(*(options_of(program, capsys) for program in ALL_PROGRAMS))
    mentioned = {option for code in CODE for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", code)}
    assert mentioned <= known | {"--version", "--help", "--max-memory"}


def test_every_make_target_named_exists() -> None:
    """Each `make` target that a page names is one of the Makefile's."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = {word for code in CODE for word in re.findall(r"(?:^|\s)make ([a-z-]+)", code)}
    assert named
    assert named <= targets


def test_the_weights_of_the_parts_are_on_the_methods_page() -> None:
    """Of the groups in both views, of a library's own two, and of the eigenvectors together."""
    page = " ".join(PAGES[ROOT / ".github/docs/method.md"].split())
    weighing, (own,) = ACROSS_LABORATORIES, WITHIN_LABORATORY.views
    eigen = [group[0].kind is Kind.EIGEN for group in weighing.groups]
    first, second = ([str(Fraction(weight).limit_denominator(9)) for weight in view] for view in weighing.views)
    whole = [str(Fraction(sum(compress(view, eigen))).limit_denominator(9)) for view in weighing.views]
    assert f"group, of weight {first[0]} (posture {first[-1]}), and a second view weighs" in page
    assert f"the short windows alone, {second[1]} each: the eigenvectors have {whole[0]} and {whole[1]}." in page
    assert f"there are two groups of weight {Fraction(own[0])}, all parts" in page
    assert (len({*first[:-1]}), len({*second}), len({*own})) == (1, 2, 1)


def test_every_program_with_json_has_a_row_on_its_page(capsys: pytest.CaptureFixture[str]) -> None:
    """The rows are those of the programs that take `--json`; `test_experiments` compares the evaluations' keys."""
    rows = re.findall(r"^\| `([a-z ]+)`", PAGES[ROOT / ".github/docs/json.md"], re.MULTILINE)
    assert set(rows) == {each for each in ALL_PROGRAMS if "--json" in options_of(each, capsys)}


def anchors(text: str) -> set[str]:
    """Give the anchors of a page's headings."""
    headings = re.findall(r"^#+ (.+)$", _FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_link_within_the_project_leads_somewhere(page: Path) -> None:
    """Each relative link or picture is a file of the project, each anchor one of that page's headings."""
    links = re.findall(r"\]\(([^)\s]+)\)", _FENCE.sub("", PAGES[page]))
    for link in links:
        if "://" in link or link.startswith("mailto:"):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(PAGES[target]), link


def test_every_page_is_linked() -> None:
    """A reader of README comes to every page: it is linked from README or from a page."""
    linked = {
        (page.parent / link.partition("#")[0]).resolve()
        for page, text in PAGES.items()
        for link in re.findall(r"\]\(([^)\s]+\.md[^)\s]*)\)", text)
        if "://" not in link
    }
    assert set(PAGES) - {ROOT / "README.md"} <= linked


def test_the_readme_is_read_in_minutes() -> None:
    """README has few lines, none of them long; it says how the tests are run."""
    lines = README.splitlines()
    assert len(lines) <= 90
    assert max(map(len, lines)) <= 110
    assert any(line.startswith("make test ") for line in lines)


def test_every_test_that_a_page_cites_is_there() -> None:
    """A page says which tests hold a promise: files of these names exist."""
    cited = {name for text in PAGES.values() for name in re.findall(r"\btest_\w+\.py\b", text)}
    assert len(cited) > 20
    assert cited <= {path.name for path in (ROOT / "tests").rglob("test_*.py")}


def test_the_pages_stay_short() -> None:
    """All pages together, the method's, which is read beside the code, and the one on strangers."""
    words = {path.name: len(text.split()) for path, text in PAGES.items() if path.is_relative_to(ROOT / ".github")}
    assert sum(words.values()) <= 14_000
    assert words["method.md"] <= 1_000
    assert words["robustness.md"] <= 1_800
