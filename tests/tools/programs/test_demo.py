"""`kinespace demo`: play motions into a recogniser on this machine, with the built-in library alone."""

import json
import math
from functools import partial
from io import StringIO
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from kinespace.library import MotionLibrary
from kinespace.tools.cli.main import main
from kinespace.tools.loopback.answers import Expected
from kinespace.tools.loopback.service_process import BackgroundService
from kinespace.tools.programs import demo

pytestmark = pytest.mark.slow

CLASSES = ("kickLFront1Reps", "squat1Reps")
#: How many times faster than a person sees it the demo plays; the frames' own times stay the same.
SPEED = 8.0


@pytest.fixture(autouse=True)
def fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Play fast."""
    monkeypatch.setattr(demo, "clip_cues", partial(demo.clip_cues, speed=SPEED))


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> MotionLibrary:
    """Let the demo know two classes only."""
    whole = MotionLibrary.builtin()
    library = whole.without(classes=[name for name in whole.classes if name not in CLASSES])
    monkeypatch.setattr(MotionLibrary, "builtin", lambda: library)
    return library


def test_the_demo_names_every_motion(capsys: pytest.CaptureFixture[str]) -> None:
    """It prints exactly one JSON object in which every class was played, answered and right."""
    assert main(["demo", "--json"]) == 0
    printed, errors = capsys.readouterr()
    assert (printed.count("\n"), errors) == (1, "")
    described = json.loads(printed)
    assert set(described) == {"played", "answered", "right", "late", "p99_ms"}
    assert described["right"] == described["played"] == described["answered"] == 11
    assert 0 < described["p99_ms"] < math.inf


def test_the_longest_motions_that_fit_are_played() -> None:
    """One motion of each class, all together about half a minute, none so short that it is hardly answered."""
    library = MotionLibrary.builtin()
    motions = demo.chosen(library)
    assert [motion.class_name for motion in motions] == list(library.classes)
    assert sum(motion.duration + 0.7 for motion in motions) == pytest.approx(30.0, abs=0.3)
    assert min(motion.duration for motion in motions) > 1.0


def test_a_recogniser_that_knows_other_names_is_not_right(
    small: MotionLibrary, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Answers other than the expected ones do not count: no motion is right, and the status is 1."""
    other = small.renamed({name: f"not {name}" for name in CLASSES})

    def service(transport: str, **options: object) -> BackgroundService:
        return BackgroundService(transport, **{**options, "library": other})  # type: ignore[arg-type]

    monkeypatch.setattr(demo, "BackgroundService", service)
    assert main(["demo", "--json"]) == 1
    assert json.loads(capsys.readouterr().out) == {
        "played": 2,
        "answered": 0,
        "right": 0,
        "late": 0,
        "p99_ms": None,
    }


@pytest.mark.usefixtures("small")
def test_on_a_terminal_the_table_fills_while_it_plays(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal gets the table again and again: first without answers, at the end with all of them."""
    terminal = Console(file=StringIO(), force_terminal=True, width=100, markup=False)
    monkeypatch.setattr(demo, "console", terminal)
    assert main(["demo", "--transport", "zmq"]) == 0
    assert isinstance(terminal.file, StringIO)
    printed = terminal.file.getvalue()
    drawn = printed.split("Motions of the built-in library")
    assert len(drawn) > 5
    assert drawn[1].count(CLASSES[1]) == 1
    assert drawn[-1].count(CLASSES[1]) == 2
    assert "over ZMQ" in printed


class _Busy:
    """A recogniser that answers late, and one at a time: in place of sender, listener and process."""

    def __init__(self, expected: list[Expected], *, most: int = 10**9) -> None:
        self._expected, self._waiting, self._most = expected, list[Expected](), most
        self.show: demo._Show
        #: The answers that were owed whenever a frame was sent.
        self.owed: list[int] = []
        self.sent = 0

    def encode(self, cue: object) -> object:
        """Leave it as it is."""
        return cue

    def send(self, _: object) -> None:
        """Owe the answers to a frame."""
        self.owed.append(self.show.owed)
        self._waiting += [each for each in self._expected if each.cue == self.sent]
        self.sent += 1

    def listen_until(self, _: float) -> list[Any]:
        """Give one answer, long after its frame."""
        if not self._waiting or not self._most:
            return []
        self._most -= 1
        answer = SimpleNamespace(label=self._waiting[0].label, score=self._waiting.pop(0).score, margin=0.1)
        return [SimpleNamespace(packet=answer, arrival=1e9)]


def _played_to(busy: _Busy, expected: list[Expected], monkeypatch: pytest.MonkeyPatch) -> demo._Show:
    monkeypatch.setattr(demo, "answer_in", lambda packet: packet)
    busy.show = demo._Show(["bow"], expected, "osc")  # noqa: SLF001 - the part of the program that waits
    cues = [SimpleNamespace(due=0.0, class_name="bow")] * 40
    demo._play(cues, busy, busy, busy.show, None)  # type: ignore[arg-type]  # noqa: SLF001 - stand-ins, as above
    return busy.show


def test_frames_wait_for_a_busy_recogniser(monkeypatch: pytest.MonkeyPatch) -> None:
    """All answers come although each frame owes two and one comes at a time; that they were late is said."""
    expected = [Expected(frame, "bow", half + frame / 100) for frame in range(40) for half in (0.0, 0.5)]
    busy = _Busy(expected)
    show = _played_to(busy, expected, monkeypatch)
    assert (show.right, show.owed, show.late) == (1, 0, 80)
    assert max(busy.owed) <= demo._MAX_OWED + 2  # noqa: SLF001 - the bound, and what the frame itself owes
    assert "1 of 1 motions named; 80 of 80 answers right, 0 lost, 80 late (after more than 0.1 s:" in show.tally()
