from types import SimpleNamespace

from kinespace.stream.teaching import commands
from kinespace.tools.teaching.keys import Keys


def test_the_commands_of_keys() -> None:
    """New motions are numbered; holding begins and ends by one key; the last name was right, or wrong."""
    keys = Keys(SimpleNamespace(classes=("squat", "motion 1")), SimpleNamespace())  # type: ignore[arg-type]  # as read
    assert keys.command_of("t") == commands.Teach("", "motion 2")
    assert keys.command_of("a") == commands.Teach("", "motion 2")
    assert [keys.command_of("h") for _ in range(2)] == [
        commands.Hold("", "motion 2"),
        commands.Hold("", "motion 2", on=False),
    ]
    assert [keys.command_of(key) for key in "ynmu?"] == [
        commands.Right(),
        commands.Wrong(),
        commands.Teach("", "nothing"),
        commands.Undo(),
        None,
    ]
