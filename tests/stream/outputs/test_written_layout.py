"""Layouts that a person wrote: what is sent, and what is said of mistakes."""

from pathlib import Path

import numpy as np
import pytest
from pythonosc.osc_packet import OscPacket

from kinespace.stream import Done, Event, EventKind, Outcome, Progress, Recognition
from kinespace.stream.outputs import LayoutSink
from kinespace.stream.outputs.layouts import LayoutFileError, WrittenLayout

FILMS = """
title = "a mixer of films"
port = 7000

[[message]]
when = "start"
class = "jump"
address = "/composition/columns/{number}/connect"
arguments = [1]

[[message]]
when = "start"
address = "/{performer}/{class}"
arguments = ["begins {class}", "{index}", "{score}"]

[[message]]
when = "answer"
address = "/fader"
arguments = ["{score}", "{margin}", "{phase}", "{speed:.1f} x", 0.5]

[[message]]
when = "done"
address = "/count"
arguments = ["{count}", "{duration}"]

[[message]]
when = "gone"
address = "/blackout"
"""


@pytest.fixture
def films(tmp_path: Path) -> WrittenLayout:
    """Read the layout above."""
    return _layout(tmp_path, FILMS)


def _layout(folder: Path, text: str) -> WrittenLayout:
    (folder / "films.toml").write_text(text, encoding="utf-8")
    return WrittenLayout(folder / "films.toml")


def _read(packet: bytes | None) -> list[tuple[str, list[object]]]:
    assert packet is not None
    return [(each.message.address, each.message.params) for each in OscPacket(packet).messages]


def test_each_moment_has_its_messages(films: WrittenLayout) -> None:
    """Numbers stay numbers, a text around a name is filled in, reserved characters of a name leave the address."""
    assert (films.name, films.port) == ("a mixer of films", 7000)
    assert _read(films.event(Event("Ada L", EventKind.START, "jump", 1, 0.75, 4.0))) == [
        ("/composition/columns/2/connect", [1]),
        ("/Ada%20L/jump", ["begins jump", 1, 0.75]),
    ]
    assert _read(films.event(Event("Ada L", EventKind.START, "bow", 0, 0.75, 4.0))) == [
        ("/Ada%20L/bow", ["begins bow", 0, 0.75])
    ]
    assert films.event(Event("Ada L", EventKind.END, "jump", 1, 0.75, 4.0)) is None
    progress = Progress("jump", 0.5, 0.5, 1.25, 0.75, sure=1.0, cycles=0)
    scores = np.array([0.25, 0.75], dtype=np.float32)
    answer = Recognition("Ada L", 4.0, Outcome.NAMED, ("bow", "jump"), scores, movement=0.2, progress=progress)
    assert _read(films.recognition(answer)) == [("/fader", [0.75, pytest.approx(answer.margin), 0.5, "1.2 x", 0.5])]
    assert _read(films.done(Done("Ada L", "jump", 1, 6.0, 1.5, 0.875, 1.25, 0.75, 3))) == [("/count", [3, 1.5])]
    assert _read(films.gone("Ada L")) == [("/blackout", [])]


def test_titles_are_sent_and_a_title_in_place_of_a_class_is_said(tmp_path: Path) -> None:
    """`{title}` is the name that people say; as a class it would never fire, and a note says which class is meant."""
    message = '[[message]]\nwhen = "start"\nclass = "{}"\naddress = "/a"\narguments = ["{{title}}"]\n'
    layout = _layout(tmp_path, message.format("squat1Reps") + message.format("kick") + message.format("bow"))
    assert _read(layout.event(Event("ann", EventKind.START, "squat1Reps", 1, 0.75, 4.0))) == [("/a", ["squat"])]
    sink = LayoutSink(layout, None)  # type: ignore[arg-type]  # nothing is sent
    sink.publish_classes(("kickLFront1Reps", "squat1Reps"))
    assert sink.notes == ["layout: no class is called 'kick', which is a title: kickLFront1Reps is meant"]
    layout.classes(("kick", "squat1Reps"))
    assert layout.notes == []


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("", "message: expected a value, got nothing"),
        ("message = []", "message: expected"),
        ('[[message]]\nwhen = "begin"\naddress = "/a"', "message 1, when: expected one of"),
        ('[[message]]\nwhen = "start"\naddress = "a"', "message 1, address: expected"),
        ('[[message]]\nwhen = "gone"\naddress = "/{class}"', "{class}: expected one of performer when gone"),
        ('[[message]]\nwhen = "start"\naddress = "/{class.__init__}"', "{class.__init__}: expected one of performer"),
        ('[[message]]\nwhen = "start"\naddress = "/a"\narguments = ["{score"]', "expected names in braces"),
        ('[[message]]\nwhen = "start"\naddress = "/a"\narguments = ["{class:d}"]', "expected numbers and texts"),
        *(
            (f'[[message]]\nwhen = "start"\naddress = "/a"\narguments = ["{{{each}}}"]', "expected a format like :.2f")
            for each in ("score:>2000000000", "index:c", "score:.999999999f", "title:{performer.__class__}", "title!r")
        ),
        ('[[message]]\nwhen = "start"\naddress = "/a"\nargument = [1]', "perhaps 'arguments' is meant"),
    ],
)
def test_a_mistake_is_said_before_anything_is_sent(tmp_path: Path, written: str, said: str) -> None:
    """The line names the file, the place, the expectation and what stands there."""
    with pytest.raises(LayoutFileError) as refused:
        _layout(tmp_path, written)
    assert said in str(refused.value)
    assert str(refused.value).startswith("films.toml: ")
