from types import SimpleNamespace

from kinespace.stream.teaching import commands
from kinespace.tools.teaching.keys import HINT, Keys


def test_the_commands_of_keys() -> None:
    """New motions are numbered, held ones too; the last name was right, or wrong; a number chooses who is taught."""
    lessons = SimpleNamespace(classes=["squat", "motion 1"], performers=SimpleNamespace(names=("ann", "bob")))
    shown = SimpleNamespace(hint=HINT)
    keys = Keys(lessons, shown)  # type: ignore[arg-type]  # as read
    assert keys.command_of("t") == commands.Teach("", "motion 2")
    lessons.classes.append("motion 2")
    assert keys.command_of("a") == commands.Teach("", "motion 2")
    held = [keys.command_of("h") for _ in range(2)]
    assert held == [commands.Hold("", "motion 3"), commands.Hold("", "motion 3", on=False)]
    assert [keys.command_of(key) for key in "ynmu?9"] == [
        commands.Right(),
        commands.Wrong(),
        commands.Teach("", "nothing"),
        commands.Undo(),
        *(None, None),
    ]
    assert keys.command_of("2") is None
    assert shown.hint.startswith("bob is taught")
    assert keys.command_of("n") == commands.Wrong("bob")
    assert keys.command_of("a") == commands.Teach("bob", "motion 3")


def test_a_motion_is_named_by_keys() -> None:
    """Letters are its name until Enter, then examples go on by it; Escape leaves the old one."""
    lessons = SimpleNamespace(classes=["motion 1"], performers=SimpleNamespace(names=("ann",)))
    shown = SimpleNamespace(hint=HINT)
    keys = Keys(lessons, shown)  # type: ignore[arg-type]  # as read
    assert keys.command_of("=") is None
    keys.command_of("t")
    assert [keys.command_of(key) for key in "=hix\x7f t"] == [None] * 7
    assert shown.hint == "motion 2 is called: hi t"
    assert keys.command_of("\n") == commands.Rename("motion 2", "hi t")
    assert (shown.hint, keys.command_of("a")) == (HINT, commands.Teach("", "hi t"))
    assert [keys.command_of(key) for key in "=x\x1b"] == [None] * 3
    assert keys.command_of("a") == commands.Teach("", "hi t")
