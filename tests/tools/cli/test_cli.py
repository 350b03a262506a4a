"""The command line: the program asked for runs, and every failure is one line and an exit status."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import ROOT, python, ran

from kinespace.tools.cli.values import host_and_port
from kinespace.tools.programs import info


def fails_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Let a program fail."""

    def fail(*_: object, **__: object) -> int:
        raise error

    monkeypatch.setattr(info, "run", fail)


def test_the_command_tells_its_version() -> None:
    """`kinespace --version`, as installed, prints the distribution's version and ends with 0."""
    command = Path(sys.executable).with_name("kinespace")
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"kinespace {version('kinespace')}\n", "")


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (FileNotFoundError(2, "No such file or directory", "a.npz"), "kinespace: a.npz: no such file or folder\n"),
        (OSError(98, "127.0.0.1:9310: Address already in use"), "kinespace: 127.0.0.1:9310: Address already in use\n"),
        (OSError("all gone"), "kinespace: all gone\n"),
        (ValueError("a: expected b,\n  got c"), "kinespace: a: expected b, got c\n"),
        (ImportError("pictures need matplotlib"), "kinespace: pictures need matplotlib\n"),
        (MemoryError(), "kinespace: MemoryError\n"),
    ],
)
def test_a_failure_is_one_line_and_status_2(error: Exception, line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A failure of a program ends with 2 and exactly one line on standard error."""
    fails_with(monkeypatch, error)
    assert ran("info") == (2, "", line)


def test_ctrl_c_ends_with_1_and_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A program interrupted by its user ends with 1 without a traceback."""
    fails_with(monkeypatch, KeyboardInterrupt())
    assert ran("info") == (1, "", "")


def test_a_mistake_of_ours_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error that no input explains is raised, so that its traceback is seen."""
    fails_with(monkeypatch, AttributeError("ours"))
    with pytest.raises(AttributeError, match="ours"):
        ran("info")


@pytest.mark.slow
def test_a_closed_output_ends_the_program_quietly() -> None:
    """When the reader of our output goes away, the program ends with 1 and an empty standard error."""
    command = [sys.executable, "-m", "kinespace", "info"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(60) == 1


def test_blas_keeps_to_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program asks BLAS for one thread, unless the environment has a number; importing sets none."""
    code = (
        "import os, sys; from kinespace.tools.cli import entry, main; main.main = lambda: 0\n"
        "print(os.environ.get('OPENBLAS_NUM_THREADS')); entry.main()\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])"
    )
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert python("-c", code, cwd=ROOT).stdout.split() == ["None", "1", "3"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        *((text, ("127.0.0.1", 9310)) for text in ("127.0.0.1:9310", "9310", ":9310")),
        *((f"{host}:{port}", (host, port)) for host, port in (("0.0.0.0", 0), ("stage.local", 65535))),  # noqa: S104 - only parsed
        *((text, ("::1", 9310)) for text in ("[::1]:9310", "::1:9310")),
    ],
)
def test_an_address_is_a_host_and_a_port(text: str, expected: tuple[str, int]) -> None:
    """The text after the last colon is the port; without a host it is this machine's port."""
    assert host_and_port(text) == expected


@given(st.text(max_size=20))
def test_any_text_is_an_address_or_refused(text: str) -> None:
    """Any text gives a host and a usable port, or the one error."""
    try:
        host, port = host_and_port(text)
    except ValueError as error:
        assert str(error).startswith("address: ")  # noqa: PT017 - most texts are no address, some are
    else:
        assert host
        assert 0 <= port <= 65535


@pytest.mark.parametrize("becomes", ["KeyboardInterrupt", "ImportError", "RuntimeError"])
def test_ctrl_c_while_it_loads_ends_it_quietly(becomes: str) -> None:
    """An interrupt while numpy is loaded ends the program with 1 and no traceback, whatever numpy makes of it."""
    interrupted = (
        "import signal, sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'numpy':\n"
        "            try: signal.raise_signal(signal.SIGINT)\n"
        f"            except KeyboardInterrupt: raise {becomes}\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "from kinespace.tools.cli.entry import main\n"
        "sys.argv[1:] = ['info']\n"
        "sys.exit(main())\n"
    )
    done = python("-c", interrupted)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "")
