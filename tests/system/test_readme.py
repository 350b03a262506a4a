"""README: what it shows runs, what it names exists."""

from __future__ import annotations

import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from programs import ROOT

from kinespace.tools.cli.main import main

if TYPE_CHECKING:
    from pathlib import Path

README = (ROOT / "README.md").read_text(encoding="utf-8")
FENCED = re.findall(r"^```(\w*)\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
PYTHON = [code for language, code in FENCED if language == "python"]
PROGRAMS = {
    *("demo", "live", "replay", "record", "convert", "feeds", "listen"),
    *("latency", "build", "learn", "info", "evaluate", "bench"),
}
#: Code spans and fenced blocks: where commands stand.
PROSE = re.sub(r"^```.*?^```", "", README, flags=re.MULTILINE | re.DOTALL)
CODE = [code for _, code in FENCED] + re.findall(r"`([^`\n]+)`", PROSE)
COMMANDS = [line for code in CODE for line in code.splitlines() if re.search(r"(^|[ /])kinespace +[a-z]", line)]


def options_of(program: str, capsys: pytest.CaptureFixture[str]) -> set[str]:
    """Ask a program which options it has."""
    with pytest.raises(SystemExit):
        main([*program.split(), "--help"])
    return set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", capsys.readouterr().out))


def test_there_is_something_to_run() -> None:
    """README shows at least one example in Python and one command."""
    assert PYTHON
    assert COMMANDS


@pytest.mark.parametrize("code", PYTHON)
def test_every_python_example_runs(code: str, tmp_path: Path) -> None:
    """Each example in Python runs by itself, in any folder, without a warning, and prints something."""
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.strip()


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_shown_exists(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Each command in README names a program there is, with options it has."""
    command = line.partition("#")[0].partition("kinespace")[2].split()
    program = " ".join(command[:2]) if command[0] == "evaluate" else command[0]
    assert command[0] in PROGRAMS
    used = {word.partition("=")[0] for word in command if re.match(r"--?[a-z]", word)}
    assert used <= options_of(program, capsys)


def test_every_option_named_alone_exists(capsys: pytest.CaptureFixture[str]) -> None:
    """Each option that stands in README without its command belongs to some program."""
    programs = [*PROGRAMS, "evaluate retrieval", "evaluate stream", "evaluate noise"]
    known = set().union(*(options_of(program, capsys) for program in programs))
    mentioned = {option for code in CODE for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", code)}
    assert mentioned <= known | {"--version", "--help"}


def test_every_make_target_named_exists() -> None:
    """Each `make` target that README names is one of the Makefile's."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    named = {word for code in CODE for word in re.findall(r"(?:^|\s)make ([a-z-]+)", code)}
    assert named
    assert named <= targets


def test_every_link_within_the_project_leads_somewhere() -> None:
    """Each relative link or picture is a file of the project, each anchor one of README's headings."""
    links = re.findall(r"\]\(([^)\s]+)\)", README)
    headings = {
        re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-")
        for heading in re.findall(r"^#+ (.+)$", README, re.MULTILINE)
    }
    assert links
    for link in links:
        if link.startswith("#"):
            assert link[1:] in headings
        elif "://" not in link and not link.startswith("mailto:"):
            assert (ROOT / link.partition("#")[0]).exists()


def test_the_first_screen_runs() -> None:
    """`make demo` stands within the first screen, after a picture."""
    first = README.splitlines()[:24]
    assert any(line.startswith("![") for line in first)
    assert "make demo" in first


def test_nothing_is_left_to_fill_in() -> None:
    """No word in capitals with underscores, and no TODO, waits in README for somebody to replace it."""
    assert re.findall(r"^[A-Z]+_[A-Z_]+$|TODO|FIXME|XXX", README, re.MULTILINE) == []
