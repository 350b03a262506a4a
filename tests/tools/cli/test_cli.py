"""The command line: the program asked for runs, and every failure is one line and an exit status."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from importlib.metadata import entry_points, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from programs import ROOT, finished

from kinespace.library import Reading
from kinespace.stream import LiveSignature, Settings
from kinespace.tools.cli import entry
from kinespace.tools.cli.arguments import OSC_IN
from kinespace.tools.cli.main import EXPERIMENTS, PROGRAMS, main
from kinespace.tools.evaluation import evaluate_retrieval
from kinespace.tools.programs import demo, latency
from kinespace.tools.programs.live import options as live
from kinespace.tools.programs.live import program as live_program
from kinespace.tools.programs.live.program import OSC_OUT
from kinespace.tools.programs.recordings import build, info
from kinespace.tools.programs.replay import options as replay
from kinespace.tools.programs.replay import program as replay_program

if TYPE_CHECKING:
    from types import ModuleType

Call = tuple[str, tuple[Any, ...], dict[str, Any]]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Call]:
    """Let every program only note its options, and end with 0."""
    calls: list[Call] = []

    def stand_in(name: str) -> Any:  # noqa: ANN401 - as any as the programs it stands for
        return lambda *arguments, **options: calls.append((name, arguments, options)) or 0

    works = (
        (demo, "demonstrate"),
        (live_program, "recognise"),
        (replay_program, "play"),
        (latency, "compare_with_echo"),
        (build, "build"),
        (info, "describe"),
        (evaluate_retrieval, "evaluate"),
    )
    for module, work in works:
        monkeypatch.setattr(module, work, stand_in(work))
    return calls


def fails_with(monkeypatch: pytest.MonkeyPatch, error: BaseException, module: ModuleType = info) -> None:
    """Let a program fail."""

    def fail(*_: object, **__: object) -> int:
        raise error

    monkeypatch.setattr(module, "run", fail)


def test_the_command_is_installed() -> None:
    """The installed distribution has one command, kinespace, and it is this one."""
    (command,) = entry_points(group="console_scripts", name="kinespace")
    assert command.load() is entry.main


def test_the_command_tells_its_version() -> None:
    """`kinespace --version`, as installed, prints the distribution's version and ends with 0."""
    command = Path(sys.executable).with_name("kinespace")
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"kinespace {version('kinespace')}\n", "")


def test_the_package_tells_its_version() -> None:
    """`kinespace.__version__` is the distribution's version; there is no other attribute that was not defined."""
    package = import_module("kinespace")
    assert package.__version__ == version("kinespace")
    with pytest.raises(AttributeError, match="has no attribute 'nope'"):
        _ = package.nope


def test_the_module_is_the_command() -> None:
    """`python -m tools` is the same program."""
    assert finished("--version") == (0, f"kinespace {version('kinespace')}\n", "")


def test_help_lists_every_program(capsys: pytest.CaptureFixture[str]) -> None:
    """`kinespace --help` ends with 0 and names every program with a line of its own."""
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    first_words = {line.split()[0] for line in capsys.readouterr().out.splitlines() if line.startswith("    ")}
    assert set(PROGRAMS) <= first_words


def test_every_program_is_found() -> None:
    """Every module below tools that takes arguments as a program does is in the tables, and no other is."""
    tools = ROOT / "tools"
    modules = {
        ".".join(path.relative_to(tools).with_suffix("").parts)
        for path in tools.rglob("*.py")
        if "\ndef add_arguments(" in path.read_text(encoding="utf-8")
    }
    assert modules == {module for module, _ in (*PROGRAMS.values(), *EXPERIMENTS.values()) if module}


@pytest.mark.parametrize("program", [*PROGRAMS, *(f"evaluate {name}" for name in EXPERIMENTS)])
def test_every_program_has_help(program: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`--help` of every program ends with 0 and describes it."""
    with pytest.raises(SystemExit) as ended:
        main([*program.split(), "--help"])
    assert ended.value.code == 0
    assert f"usage: kinespace {program}" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        "",
        "dance",
        "demo --seconds 0",
        "demo --seconds soon",
        "demo --seconds inf",
        "demo --transport carrier-pigeon",
        "live --window 0",
        "live --window nan",
        "live --hop -1",
        "live --performers many",
        "live extra",
        "replay clip.amc --speed 0",
        "replay clip.amc --speed -1",
        "replay clip.amc --pause -0.1",
        "replay clip.amc --drop 1.1",
        "replay clip.amc --drop nan",
        "replay clip.amc --reorder -0.1",
        "replay clip.amc --jitter-ms inf",
        "replay clip.amc --seed 1.5",
        "latency --rate 0",
        "latency --transport both --seconds -1",
        "build clips",
        "build -o mine.npz",
        "build clips -o mine.npz --frame-rate 0",
        "info one.npz two.npz",
        "evaluate",
        "evaluate dance clips",
        "evaluate retrieval clips --space time",
        "evaluate retrieval clips --protocol none",
        "evaluate retrieval clips --seed x",
    ],
)
def test_wrong_arguments_end_with_2(arguments: str, asked: list[Call], capsys: pytest.CaptureFixture[str]) -> None:
    """A wrong program, option or value ends with 2 and one line on standard error; no program runs."""
    with pytest.raises(SystemExit) as ended:
        main(arguments.split())
    assert ended.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    assert ": error: " in line
    assert asked == []


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ("demo", ("demonstrate", ("osc",), {"seconds": 30.0, "picture": None, "as_json": False})),
        (
            "demo --transport zmq --seconds 24 --picture demo.svg --json",
            ("demonstrate", ("zmq",), {"seconds": 24.0, "picture": Path("demo.svg"), "as_json": True}),
        ),
        ("info", ("describe", (None, Reading()), {})),
        ("info mine.npz", ("describe", (Path("mine.npz"), Reading()), {})),
        (
            "build a b.npz -o c.npz --asf d.asf --frame-rate 60 --licence CC0 --attribution me",
            (
                "build",
                ([Path("a"), Path("b.npz")], Path("c.npz")),
                {"reading": Reading(asf=Path("d.asf"), frame_rate=60.0), "terms": build.Terms("CC0", "me")},
            ),
        ),
        (
            "latency",
            (
                "compare_with_echo",
                (("osc", "zmq"),),
                {"rate_hz": 120.0, "seconds": 20.0, "settings": Settings(), "as_json": False},
            ),
        ),
        (
            "latency --transport zmq --rate 60 --seconds 5 --signature paper --window 2 --hop 0 --json",
            (
                "compare_with_echo",
                (("zmq",),),
                {
                    "rate_hz": 60.0,
                    "seconds": 5.0,
                    "settings": Settings(signature=LiveSignature.PAPER, window=2.0, hop=0.0),
                    "as_json": True,
                },
            ),
        ),
        (
            "evaluate retrieval a b",
            (
                "evaluate",
                ([Path("a"), Path("b")],),
                {"space": None, "protocol": None, "turned_by": None, "picture": None, "as_json": False},
            ),
        ),
        (
            "evaluate retrieval a --space rotations --protocol split --turned --seed 3 --picture p.png --json",
            (
                "evaluate",
                ([Path("a")],),
                {
                    "space": "rotations",
                    "protocol": "split",
                    "turned_by": 3,
                    "picture": Path("p.png"),
                    "as_json": True,
                },
            ),
        ),
        (
            (
                "live --osc-in :1 --zmq-out tcp://*:2 --library l.npz --signature paper --window 2 --hop 0.1 "
                "--performers 3 --plain"
            ),
            (
                "recognise",
                (live.Addresses(osc_in=":1", zmq_out="tcp://*:2"),),
                {
                    "library": Path("l.npz"),
                    "settings": Settings(signature=LiveSignature.PAPER, window=2.0, hop=0.1),
                    "most": 3,
                    "plain": True,
                    "feed": live.Feed(),
                },
            ),
        ),
        (
            "live",
            (
                "recognise",
                (live.Addresses(osc_in=OSC_IN, osc_out=OSC_OUT),),
                {"library": None, "settings": Settings(), "most": 32, "plain": False, "feed": live.Feed()},
            ),
        ),
        (
            "live --feed my.toml --sender 10.0.0.2 --out vrchat,puredata --out max=10.0.0.3:7401",
            (
                "recognise",
                (live.Addresses(),),
                {
                    "library": None,
                    "settings": Settings(),
                    "most": 32,
                    "plain": False,
                    "feed": live.Feed("my.toml", "10.0.0.2", ("vrchat", "puredata", "max=10.0.0.3:7401")),
                },
            ),
        ),
        ("live --osc-out 9400", ("recognise", (live.Addresses(osc_in=OSC_IN, osc_out="9400"),), {})),
        ("live --zmq-out t://h:2", ("recognise", (live.Addresses(osc_in=OSC_IN, zmq_out="t://h:2"),), {})),
        ("live --zmq-in t://h:1", ("recognise", (live.Addresses(zmq_in="t://h:1", osc_out=OSC_OUT),), {})),
        ("live --out max", ("recognise", (live.Addresses(osc_in=OSC_IN),), {"feed": live.Feed(outs=("max",))})),
        (
            "live --signature windows --sensitivity 0.3",
            (
                "recognise",
                (live.Addresses(osc_in=OSC_IN, osc_out=OSC_OUT),),
                {"settings": Settings(signature=LiveSignature.WINDOWS, sensitivity=0.3)},
            ),
        ),
        ("replay", ("play", ([],), {"reading": Reading(), "osc_to": OSC_IN})),
        (
            "replay a b",
            (
                "play",
                ([Path("a"), Path("b")],),
                {
                    "reading": Reading(),
                    "osc_to": OSC_IN,
                    "zmq_to": None,
                    "listen": None,
                    "course": replay.Course("replay"),
                    "faults": replay.Faults(),
                    "as_json": False,
                },
            ),
        ),
        (
            (
                "replay a --zmq t://h:1 --listen t://h:2 --performer me --speed 2 --pause 0 --loop --drop .1 "
                "--jitter-ms 20 --reorder .2 --seed 5 --asf s.asf --json"
            ),
            (
                "play",
                ([Path("a")],),
                {
                    "reading": Reading(asf=Path("s.asf")),
                    "osc_to": None,
                    "zmq_to": "t://h:1",
                    "listen": "t://h:2",
                    "course": replay.Course("me", speed=2.0, pause=0.0, loop=True),
                    "faults": replay.Faults(drop=0.1, jitter=0.02, reorder=0.2, seed=5),
                    "as_json": True,
                },
            ),
        ),
    ],
)
def test_every_option_reaches_its_program(arguments: str, expected: Call, asked: list[Call]) -> None:
    """Every option reaches its program with the value typed; the other options have their defaults."""
    assert main(arguments.split()) == 0
    ((program, positional, options),) = asked
    assert (program, positional) == expected[:2]
    assert {name: options[name] for name in expected[2]} == expected[2]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ("--window 0.5", "--window: expected --signature paper with it, got windows"),
        ("--signature windows --window 0.5", "--window: expected --signature paper with it, got windows"),
        ("--signature paper --sensitivity 0.1", "--sensitivity: expected --signature windows with it, got paper"),
        ("--signature paper --progress", "--progress: expected --signature windows with it, got paper"),
    ],
)
@pytest.mark.parametrize("program", ["live", "latency"])
def test_settings_without_effect_are_refused(
    program: str, options: str, told: str, asked: list[Call], capsys: pytest.CaptureFixture[str]
) -> None:
    """A setting that would have no effect ends with 2 and one line."""
    assert main([program, *options.split()]) == 2
    assert capsys.readouterr().err == f"kinespace: {told}\n"
    assert asked == []


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("lvie", ", perhaps live or listen is meant;"),
        ("live --libary none", "kinespace live: error: unknown argument --libary, perhaps --library is meant;"),
        ("live --libary=none", "kinespace live: error: unknown argument --libary, perhaps --library is meant;"),
        ("live --signature papr", ", perhaps paper is meant;"),
        ("live --feed rokokko", "kinespace: --feed: expected one of captury, "),
        ("live --feed rokokko", "got 'rokokko', perhaps rokoko is meant"),
        ("live --joints xsans", "kinespace: --joints: expected one of kinectv2, "),
        ("live --joints xsans", "got 'xsans', perhaps xsens is meant"),
        ("live --names mixamoo", "kinespace: --names: expected one of acclaim-bvh, "),
        ("live --names mixamoo", "got 'mixamoo', perhaps mixamo is meant"),
        ("live --osc-in :0 --out max,puredat", "got 'puredat', perhaps puredata is meant"),
        ("live --osc-in :0 --osc-out here", "kinespace: --osc-out: expected HOST:PORT, "),
        ("feeds rokokko", "got 'rokokko', perhaps rokoko is meant"),
        ("replay squat", "kinespace: squat: no such file or folder, perhaps squat1Reps is meant"),
        ("info Squat", "kinespace: Squat: no such file or folder, perhaps squat1Reps is meant"),
        ("replay tango", "kinespace: tango: no such file or folder, nor a class of the built-in library"),
    ],
)
def test_a_mistyped_name_is_told_with_its_neighbours(
    arguments: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line names what was typed and the names near it."""
    try:
        status = main(arguments.split())
    except SystemExit as ended:
        status = ended.code  # type: ignore[assignment]  # argparse gives a number
    assert status == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line


def test_json_of_latency_needs_one_transport(asked: list[Call], capsys: pytest.CaptureFixture[str]) -> None:
    """`latency --json` without one transport would be two objects: it ends with 2 and one line."""
    assert main(["latency", "--json"]) == 2
    assert capsys.readouterr().err == "kinespace: --json: expected --transport osc or zmq with it, got both\n"
    assert asked == []


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (FileNotFoundError(2, "No such file or directory", "a.npz"), "kinespace: a.npz: No such file or directory\n"),
        (OSError(98, "127.0.0.1:9310: Address already in use"), "kinespace: 127.0.0.1:9310: Address already in use\n"),
        (OSError("all gone"), "kinespace: all gone\n"),
        (TimeoutError("not reached"), "kinespace: not reached\n"),
        (ValueError("a: expected b,\n  got c"), "kinespace: a: expected b, got c\n"),
        (ImportError("pictures need matplotlib"), "kinespace: pictures need matplotlib\n"),
        (MemoryError("3 TiB"), "kinespace: 3 TiB\n"),
        (MemoryError(), "kinespace: MemoryError\n"),
    ],
)
def test_a_failure_is_one_line_and_status_2(
    error: Exception, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A failure of a program ends with 2 and exactly one line on standard error."""
    fails_with(monkeypatch, error)
    assert main(["info"]) == 2
    assert capsys.readouterr() == ("", line)


def test_ctrl_c_ends_with_1_and_says_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A program interrupted by its user ends with 1 without a traceback."""
    fails_with(monkeypatch, KeyboardInterrupt())
    assert main(["info"]) == 1
    assert capsys.readouterr() == ("", "")


def test_a_mistake_of_ours_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error that no input explains is raised, so that its traceback is seen."""
    fails_with(monkeypatch, AttributeError("ours"))
    with pytest.raises(AttributeError, match="ours"):
        main(["info"])


@pytest.mark.slow
def test_a_closed_output_ends_the_program_quietly() -> None:
    """When the reader of our output goes away, the program ends with 1 and an empty standard error."""
    command = [sys.executable, "-m", "kinespace", "info"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stderr
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait(60) == 1


def test_the_version_loads_no_numpy() -> None:
    """Asking for the version loads neither numpy nor matplotlib nor a transport."""
    code = "import sys; from kinespace.tools.cli.main import main\ntry: main(['--version'])\nexcept SystemExit: pass\n"
    code += "print([name for name in ('numpy', 'matplotlib', 'zmq', 'pythonosc', 'rich') if name in sys.modules])"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.splitlines()[-1] == "[]"


def test_blas_keeps_to_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program asks BLAS for one thread, unless the environment has a number; importing sets none."""
    code = (
        "import os, sys; from kinespace.tools.cli import entry, main; main.main = lambda: 0\n"
        "print(os.environ.get('OPENBLAS_NUM_THREADS')); entry.main()\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])"
    )
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == ["None", "1", "3"]
