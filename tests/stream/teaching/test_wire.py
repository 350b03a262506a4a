import json

import pytest

from kinespace.stream.osc import decode_packet, encode_message
from kinespace.stream.osc.packet import encode_bundle
from kinespace.stream.teaching import State, Step, Taught, commands
from kinespace.stream.teaching.commands import CommandError, Tried

TOO_OFTEN = "if you did not do it, teach nothing, or show a larger gesture"


def _read(said: bytes | dict[str, object]) -> list[commands.Command]:
    """Read an OSC packet, or a request in JSON."""
    if isinstance(said, dict):
        return [commands.decode_json(json.dumps(said).encode())]
    return commands.decode(commands.said_in(said)[0])


@pytest.mark.parametrize(
    ("said", "command"),
    [
        (encode_message("/motion/teach", "ann", "wave"), commands.Teach("ann", "wave")),
        (encode_message("/motion/teach", "", "nothing", 3.0, 1), commands.Teach("", "nothing", 3, 1.0)),
        (encode_message("/motion/teach/stop"), commands.Stop()),
        (encode_message("/motion/teach/undo"), commands.Undo()),
        (encode_message("/motion/teach/rename", "a", "b"), commands.Rename("a", "b")),
        (encode_message("/motion/teach/enable", "a", 0), commands.Enable("a", on=False)),
        (encode_message("/motion/teach/last", "ann", 2.5, "bow"), commands.Last("ann", 2.5, "bow")),
        (encode_message("/motion/teach/hold", "ann", "bow", 0), commands.Hold("ann", "bow", on=False)),
        (encode_message("/motion/teach/wrong", "ann"), commands.Wrong("ann")),
        (encode_message("/motion/Ada_1/count/reset"), commands.Reset("Ada_1")),
        (encode_message("/motion/*/count/reset", 1), commands.Reset()),
        ({"do": "teach", "performer": "ann", "class": "wave"}, commands.Teach("ann", "wave")),
        ({"do": "teach", "class": "wave", "performer": "", "countdown": 0}, commands.Teach("", "wave", 1, 0.0)),
        ({"do": "forget", "class": "wave"}, commands.Forget("wave")),
        ({"do": "enable", "class": "wave", "on": True}, commands.Enable("wave", on=True)),
        ({"do": "sensitivity", "share": 0.1}, commands.Sensitivity(0.1)),
        ({"do": "wrong", "performer": "ann"}, commands.Wrong("ann")),
        (
            {"do": "last", "performer": "", "seconds": 2.0, "class": "bow", "ago": 5.5},
            commands.Last("", 2.0, "bow", 5.5),
        ),
    ],
)
def test_commands_by_osc_and_in_json(said: bytes | dict[str, object], command: commands.Command) -> None:
    """Every OSC message of the page, and every JSON request, is the command that it stands for."""
    assert _read(said) == [command]
    if isinstance(said, bytes):
        alone, among_others = commands.said_in(said), encode_bundle(encode_message("/other", 1), said)
        assert (alone[1], commands.said_in(among_others)) == (0, (alone[0], 1))


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (encode_message("/motion/teach", "ann", "a/b"), "without /"),
        (encode_message("/motion/teach", "ann", "still"), "another name"),
        (encode_message("/motion/teach", "a" * 65, "wave"), "performer"),
        (encode_message("/motion/teach", "ann", 3), "class: expected str, got 3"),
        (encode_message("/motion/teach", "ann", "wave", 0), "repetitions"),
        (encode_message("/motion/teach", "ann", "wave", float("nan")), "repetitions: expected int, got nan"),
        (encode_message("/motion/teach/hold", "ann", "wave", float("inf")), "on: expected bool, got inf"),
        (encode_message("/motion/teach", "ann", "wave", 1, 1, 1), "expected performer, class"),
        (encode_message("/motion/teach/last", "ann", 60.0, "bow"), "seconds"),
        (encode_message("/motion/teach/jump"), "expected one of"),
        (b"/motion/teach", "expected OSC"),
        (encode_bundle(*[encode_message("/motion/teach/undo")] * 9), "at most 8 commands, got 9"),
        ({"do": "teach", "class": "wave"}, "teach: expected performer, class, .*, got no performer"),
        ({"do": "enable", "class": "wave"}, "enable: expected class, on, got no on"),
        # Half a character, which JSON can write and no transport can send.
        ({"do": "teach", "performer": "\ud800", "class": "bow"}, r"performer: expected str, got '\\ud800'"),
        ({"do": "undo", "on": True}, "undo: expected no more, got 'on'"),
        ({"do": "sensitivity", "share": 1.5}, "share: expected 0 to 1, got 1.5"),
        ({"do": "last", "performer": "ann", "seconds": 2.0, "class": "wave", "ago": -1.0}, "ago"),
    ],
)
def test_bad_commands_are_one_line(said: bytes | dict[str, object], told: str) -> None:
    """A command that cannot be read, lacks an argument or has another one raises one line with the expectation."""
    with pytest.raises(CommandError, match=told) as raised:
        _read(said)
    assert "\n" not in str(raised.value)


def test_notices() -> None:
    """Every notice has its OSC message and its JSON."""
    state, taught = State("ann", Step.REFUSED, 1.5, "why"), Taught("wave", 2, 1.25, "good", Tried(3, 2, 180.0))
    waiting = commands.as_json(State("ann", Step.WAITING, 1.23456))
    assert waiting == {"performer": "ann", "state": "waiting", "seconds": 1.235}
    assert commands.as_line(state) == "teaching ann: refused 1.5 s: why"
    assert commands.as_line(State("", Step.DONE)) == "teaching: done"
    assert decode_packet(commands.encode(state)) == [("/motion/teach/state", ["ann", "refused", 1.5, "why"])]
    assert decode_packet(commands.encode(taught)) == [("/motion/teach/taught", ["wave", 2, 1.25, "good", 3, 2, 180.0])]
    assert commands.as_json(state) == {"performer": "ann", "state": "refused", "seconds": 1.5, "reason": "why"}
    tried = f"done 2 times in your last 3 minutes (40 an hour); {TOO_OFTEN}"
    kept = "taught wave: good; examples: 2, 1.2 s kept"
    assert commands.as_line(taught) == f"{kept}; it would have been {tried}"
    assert commands.as_line(Taught("wave", 2, 1.25, "good")) == kept
    would_have = {"would_have_started": 3, "would_have_been_done": 2, "tried_seconds": 180.0, "tried": tried}
    assert commands.as_json(taught) == {"taught": "wave", "examples": 2, "seconds": 1.25, "check": "good"} | would_have


@pytest.mark.parametrize(
    ("tried", "words"),
    [
        (Tried(), ""),
        (Tried(4, 0, 300.0), "done not once in your last 5 minutes"),
        (Tried(0, 0, 42.0), "done not once in your last 42 s"),
        (Tried(0, 1, 42.0), f"done once in your last 42 s; {TOO_OFTEN}"),
    ],
)
def test_how_often_a_class_would_have_been_said(tried: Tried, words: str) -> None:
    """In words, by the hour where it was seen for a minute, and what to do where it is too often."""
    assert tried.words == words
