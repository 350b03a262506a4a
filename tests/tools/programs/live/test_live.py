"""`kinespace live`: a real process that is fed over real sockets, and stopped as a person stops it."""

import re
from collections.abc import Sequence
from pathlib import Path

import pytest
from programs import (
    LOOPBACK,
    builtin_library,
    free_udp_port,
    ghost_cues,
    live,
    started,
)

from kinespace.stream import Announcement, Settings, osc
from kinespace.tools.cli.main import main
from kinespace.tools.feeding.feed import Cue
from kinespace.tools.feeding.service import expected_answers
from kinespace.tools.programs.live import OSC_OUT

pytestmark = pytest.mark.slow


def expected_of(cues: Sequence[Cue], settings: Settings | None = None) -> list[str]:
    """Give the labels that will be answered."""
    return [each.label for each in expected_answers(cues, builtin_library(), settings or Settings())]


@pytest.mark.parametrize(
    ("options", "answering"),
    [
        ("--osc-in 127.0.0.1:0", f"native {OSC_OUT}"),
        (
            "--osc-in 127.0.0.1:0 --osc-out 9 --zmq-in tcp://127.0.0.1:* --zmq-out tcp://127.0.0.1:*",
            r"native 127.0.0.1:9, ZeroMQ tcp://127\.0\.0\.1:\d+",
        ),
        (
            "--osc-in 127.0.0.1:0 --out vrchat,puredata --out max=127.0.0.2:7401",
            "vrchat .*, puredata .*, max 127.0.0.2:7401",
        ),
        (
            "--feed vmc --sender 10.0.0.2 --osc-in 127.0.0.1:0 --zmq-out tcp://127.0.0.1:*",
            r"ZeroMQ tcp://127\.0\.0\.1:\d+",
        ),
    ],
)
def test_it_says_where_it_listens_and_answers(options: str, answering: str) -> None:
    """With an input alone answers go where they always go, else where they were asked for; the line says so."""
    with started("live", "--plain", *options.split()) as program:
        program.expect(rf"listening on (OSC|vmc) 127\.0\.0\.1:[1-9].*; answering to {answering}; Ctrl-C ends\n")
        assert (program.interrupt(), program.errors) == (0, "")


def test_every_frame_is_answered_that_is_due() -> None:
    """Over OSC the answers equal the expected ones, one by one, and the counts at the end are exact."""
    cues = ghost_cues("squat1Reps", 2.0)
    expected = expected_of(cues)
    with live("--plain", "--zmq-out", f"tcp://{LOOPBACK}:*", "--bodies") as stage:
        stage.sender.announce(Announcement("ghost", builtin_library().skeleton.joints))
        stage.play(cues)
        answers = stage.answers(len(expected))
        counts = stage.stopped()
    assert [answer.label for answer in answers] == expected
    assert {answer.performer for answer in answers} == {"ghost"}
    lost = {name: 0 for name in counts if name not in ("received", "frames", "answers")}
    assert counts == {"received": 241, "frames": 240, "answers": len(expected), **lost}


def test_no_performers_name_ends_live() -> None:
    """Performers with any name are answered and shown in the table, and the program ends normally."""
    names = {"[/]": "[/]", "two words": "two words", "\x1b[2J\n": "\ufffd[2J\ufffd", "舞": "舞"}
    with live(environment={"FORCE_COLOR": "1"}) as stage:
        for name, shown in names.items():
            cues = ghost_cues("squat1Reps", 1.2, performer=name)
            stage.play(cues)
            answers = stage.answers(len(expected_of(cues)))
            # On a machine that stood still the names before are gone.
            assert osc.address_part(name) in {answer.performer for answer in answers}
            stage.program.expect(re.escape(shown))
        assert stage.stopped()["frames"] == 4 * 144


@pytest.mark.parametrize("listening", [LOOPBACK, "0.0.0.0"])  # noqa: S104 - all networks include this machine
@pytest.mark.parametrize("target", ["--osc-out {0}:{1}", "--out max={0}:{1}", "--out native=sender:{1}"])
def test_answers_to_our_own_port_are_refused(listening: str, target: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Answers that would come in again as frames are refused, wherever they would come in."""
    port = free_udp_port()
    options = target.format(LOOPBACK, port).split()
    assert main(["live", "--osc-in", f"{listening}:{port}", "--signature", "paper", *options]) == 2
    assert f"expected another place than {listening}:{port}, where frames come in" in capsys.readouterr().err


@pytest.mark.parametrize("options", ["--teach {0} --record {0}", "--library {0} --record {0}"])
def test_a_file_has_one_purpose(options: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`--overwrite` is no leave to write over the library that is read or taught."""
    library = tmp_path / "mine.npz"
    library.write_bytes(b"mine")
    given = options.format(library).split()
    assert main(["live", "--osc-in", "127.0.0.1:0", "--overwrite", *given]) == 2
    assert "expected a file for each purpose, got one for several" in capsys.readouterr().err
    assert library.read_bytes() == b"mine"
