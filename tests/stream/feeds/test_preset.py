"""Presets: the built-in ones are complete, and a mistake in a user's own is one line with its place."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kinespace.library.naming.hdm05 import SKELETON
from kinespace.stream.feeds import PresetError, builtin_names, builtin_preset, load_preset
from kinespace.stream.feeds.preset import Closing, parse_preset

GOOD = """
port = 7000
[[message]]
address = "/joint/{joint}"
arguments = ["x", "y", "z"]
[joints]
hand = "lhand"
head = "head"
"""


@pytest.mark.parametrize("name", builtin_names())
def test_a_preset_is_whole_and_its_copy_is_the_same(name: str, tmp_path: Path) -> None:
    """Each has a product, something to set, at least nine joints of HDM05's, and means the same in one's own file."""
    path = tmp_path / "mine.toml"
    path.write_text(builtin_preset(name).text, encoding="utf-8")
    mine, theirs = load_preset(path), builtin_preset(name)
    assert (mine.name, theirs.name) == ("mine", name)
    assert theirs.product
    assert "nothing: this is your own" not in theirs.sender
    assert len(theirs.joints) >= 9
    assert set(theirs.joints) <= set(SKELETON.joints)
    assert {Closing.TIMEOUT} <= theirs.closings.by
    for field in ("port", "joints", "messages", "closings", "order", "bones", "axes", "metres", "asking", "seconds"):
        assert getattr(mine, field) == getattr(theirs, field)


def test_the_least_that_is_needed_is_little() -> None:
    """A port, a message and two joints are a preset; the rest has defaults."""
    preset = parse_preset(GOOD, "mine", "mine.toml")
    assert (preset.port, preset.joints, preset.performer) == (7000, ("lhand", "head"), "mine")
    assert preset.closings.by == {Closing.REPEAT, Closing.TIMEOUT}
    assert (preset.metres, preset.axes, preset.clock) == ((1.0,) * 3, ((0, 1.0), (1, 1.0), (2, 1.0)), "arrival")


#: Mistakes by the text in whose place they stand, and the beginning of the line that says so.
MISTAKES = {
    "port = 7000": {
        "prot = 7000": "prot: expected one of ask, axes, bones, clock, frame, guessed, joints, message, metres, ",
        "port = 70000": "port: expected a whole number <= 65535, got 70000",
        f"port = 1{'0' * 400}": "port: expected a whole number <= 65535, got 1000",
        "port = 7000\nmetres = [1, 2]": "metres: expected a list of length 3, got [1, 2]",
        "port = 7000\nmetres = 0": "metres 1: expected a number >= 1e-09, got 0",
        "port = 7000\nmetres = inf": "metres 1: expected a number <= 1000000000.0, got inf",
        'port = 7000\naxes = "x y"': "axes: expected x, y and z in some order",
        'port = 7000\naxes = "x --y z"': "axes: expected x, y and z in some order",
        'port = 7000\nclock = "mine"': "clock: expected one of arrival, sender, got 'mine'",
        'port = 7000\norder = ["tail"]': "order: expected names that stand in [joints], got 'tail'",
        'port = 7000\norder = ["head", "Head"]': "order: expected distinct names",
    },
    "[[message]]": {
        "[frame]\nhold = -1\n[[message]]": "frame, hold: expected a number >= 0.0, got -1",
        '[frame]\nclose = ["soon"]\n[[message]]': "frame, close 1: expected one of end, bundle",
        '[frame]\nwords = { Good = "x" }\n[[message]]': "frame, words, Good: expected a number, got 'x'",
    },
    '"/joint/{joint}"': {
        '"joint"': "message 1, address: expected text matching regex '^/', got 'joint'",
        '"/{bone}"': "message 1, address: expected only {joint}, {performer}, {skip}, {any} in br",
        '"/{joint}/{joint}"': "message 1, address: expected each of {joint} and {performer} once",
        '"/joint"': "message: expected at least one that holds x, y and z",
        '"/{any}/{any}/{joint}"': "message 1, address: expected at most 6 names in braces, one between two slashes, a",
        '"/{joint}{skip}"': "message 1, address: expected at most 6 names in braces, one between two slashes, and {any",
        f'"/{"{skip}/" * 6}{{joint}}"': "message 1, address: expected at most 6 names in braces",
        f'"/{"a" * 256}"': "message 1, address: expected text of length <= 256, got",
    },
    '"x", "y", "z"': {
        '"x", "y"': "message 1, arguments: expected joint, x, y, z in a joint message, z too",
        '"x", "y", "z", "w"': "message 1, arguments 4: expected text matching regex '^(joint|",
        '"x", "y", "z", "x"': "message 1, arguments: expected each role but skip once",
        '"x", "y", "z", "qx"': "message 1, arguments: expected all of qx, qy, qz, qw or none",
    },
    'arguments = ["x", "y", "z"]': {'each = ["x", "y", "z"]': "order: expected the joints' order"},
    'head = "head"': {
        "": "joints: expected at least two joints",
        'Hand = "head"': "joints: expected names that differ in more than capitals",
        'head = "head"\n[bones]\nhand = {}': "joints: expected names that stand in [bones], got 'hea",
        'head = "head"\n[bones]\nhead = { parent = "hand" }\nhand = {}': "bones, head, parent: expected a bone before ",
        'head = "head"\n[bones]\nhead = {}\nhand = {}': "message: expected one with qx, qy, qz, qw",
        'head = "head"\n[bones]\nhead = { length = 1 }': "bones, head, length: expected one of offset, parent, got",
        'head = "head"\n[ask]\nport = 1': "ask, message: expected a value, got nothing",
        'head = "head"\n[ask]\nport = 1\n[[ask.message]]\naddress = "x"': "ask, message 1, address: ex",
    },
}


@pytest.mark.parametrize(("old", "new"), [(old, new) for old, mistakes in MISTAKES.items() for new in mistakes])
def test_a_mistake_is_one_line(old: str, new: str) -> None:
    """The line has the file, the key, the expectation and the value found."""
    assert old in GOOD
    with pytest.raises(PresetError) as caught:
        parse_preset(GOOD.replace(old, new), "mine", "mine.toml")
    told = str(caught.value)
    assert told.startswith(f"mine.toml: {MISTAKES[old][new]}")
    assert "\n" not in told
    assert ", got " in told


def refusal(text: str) -> str:
    """Give the reason why a preset is refused; empty when it is not."""
    try:
        parse_preset(text, "mine", "mine.toml")
    except PresetError as error:
        return str(error)
    return ""


@given(st.sampled_from(GOOD.split("\n")[1:]), st.text(max_size=30))
def test_no_text_raises_anything_else(line: str, put: str) -> None:
    """With any text in place of a line, a preset is read or raises one PresetError of one line."""
    told = refusal(GOOD.replace(line, put))
    assert told == "" or told.startswith("mine.toml: ")
    assert "\n" not in told
