"""README and its pages: their examples run, and their links and options exist."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from programs import ROOT

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


@pytest.mark.slow
def test_every_python_example_runs(tmp_path: Path) -> None:
    """Each example in Python runs with names of its own, in any folder, without a warning, and prints something."""
    program = "import sys\nfor code in sys.argv[1:]:\n    exec(code, {})\n    print('=====')"
    command = [sys.executable, "-W", "error", "-c", program, *PYTHON]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert all(printed.strip() for printed in done.stdout.split("=====\n")[: len(PYTHON)])


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
        str(ROOT / ".mypy_cache" / "examples"),
        "--ignore-missing-imports",
        "--disable-error-code=import-untyped",
    ]
    environment = {**os.environ, "MYPYPATH": str(tmp_path)}
    checked = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "\n".join(line for line in checked.stdout.splitlines() if line.startswith("example")) == ""


def test_every_command_shown_exists(capsys: pytest.CaptureFixture[str]) -> None:
    """Each command on a page names a program there is, with options it has."""
    known = {program: options_of(program, capsys) for program in ALL_PROGRAMS}
    for line in COMMANDS:
        command = line.split()
        program = " ".join(command[:2]) if command[0] == "evaluate" else command[0]
        used = {word.partition("=")[0] for word in command if re.match(r"--?[a-z]", word)}
        assert used <= known[program], line


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
