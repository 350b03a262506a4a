import pytest
from test_teacher import Stage

from kinespace.stream.recognition import Event, EventKind
from kinespace.stream.teaching import State, Step, commands
from kinespace.stream.teaching.teacher import NamedMotions


def _event(kind: EventKind, time: float, label: str = "squat1Reps", performer: str = "ann") -> Event:
    return Event(performer, kind, label, 0, 0.9, time)


def _performed(stage: Stage, *, going_on: bool = False) -> float:
    """Perform a motion that is named some time after its beginning; give its seconds."""
    stage.stand(2.0)
    began = 100 + stage.now
    motion = stage.library.motions[40]
    stage.teacher.named.push(_event(EventKind.START, began + 0.4))
    stage.show(motion.positions[:90] if going_on else motion.positions)
    if not going_on:
        stage.stand(0.7, 40)
        stage.teacher.named.push(_event(EventKind.END, 100 + stage.now))
    return motion.duration


@pytest.mark.parametrize(
    ("command", "class_name", "around"),
    [(commands.Right("ann"), "squat1Reps", 0.0), (commands.Wrong(), "nothing", 1.8)],
)
def test_the_last_named_motion_becomes_an_example(command: commands.Command, class_name: str, around: float) -> None:
    """It becomes one of its class, or with what surrounds it of nothing, once; undone it may be judged again."""
    stage = Stage()
    seconds = _performed(stage)
    assert [each.step for each in stage.ask(command) if isinstance(each, State)] == [Step.CHECKING]
    (example,) = stage.teacher.roster.examples
    assert example.class_name == class_name
    assert example.motion.duration == pytest.approx(seconds + around, abs=0.45)
    stage.ask(command)
    assert stage.reason() == "squat1Reps was judged already: undo it first"
    stage.ask(commands.Undo())
    assert stage.teacher.roster.examples == ()
    stage.ask(commands.Wrong("ann"))
    assert [each.class_name for each in stage.teacher.roster.examples] == ["nothing"]


def test_a_motion_that_goes_on_is_taken_when_it_ends() -> None:
    """Its example has all of it; one that goes on and on is taken after fifteen seconds."""
    stage = Stage()
    _performed(stage, going_on=True)
    stage.ask(commands.Right("ann"))
    assert stage.reason() == "squat1Reps: taken when it ends"
    motion = stage.library.motions[40]
    stage.show(motion.positions[90:])
    assert stage.teacher.roster.examples == ()
    stage.stand(0.7, 40)
    stage.teacher.named.push(_event(EventKind.END, 100 + stage.now))
    stage.stand(0.1, 40)
    (example,) = stage.teacher.roster.examples
    assert (example.class_name, example.seconds) == ("squat1Reps", pytest.approx(motion.duration, abs=0.45))
    _performed(stage, going_on=True)
    stage.ask(commands.Right("ann"))
    stage.show([*motion.positions, *motion.positions[::-1]] * 6)
    assert [each.class_name for each in stage.teacher.roster.examples] == ["squat1Reps"] * 2


@pytest.mark.parametrize("lasts", [0.1, 0.5, None])
def test_a_false_start_is_taken_at_once_whatever_its_length(lasts: float | None) -> None:
    """With a second and a half before it and up to now, though hardly anything moved, and though it goes on."""
    stage = Stage()
    stage.stand(3.0)
    stage.teacher.named.push(_event(EventKind.START, 100 + stage.now))
    stage.stand(lasts or 0.5)
    if lasts:
        stage.teacher.named.push(_event(EventKind.END, 100 + stage.now))
    stage.ask(commands.Wrong())
    (example,) = stage.teacher.roster.examples
    assert (example.class_name, example.seconds) == ("nothing", pytest.approx(1.5 + (lasts or 0.5), abs=0.1))
    stage.stand(1.0)
    assert len(stage.teacher.roster.examples) == 1


def test_what_surrounds_a_false_start_ends_where_other_motions_or_pauses_are() -> None:
    """The motion before it and the one behind it were right, and a pause in the feed is no movement."""
    stage = Stage()
    stage.stand(4.0)
    for kind, moment in (("start", 101.0), ("end", 102.0), ("start", 102.5), ("end", 102.7), ("start", 103.8)):
        stage.teacher.named.push(_event(EventKind(kind), moment))
    stage.ask(commands.Wrong())
    (example,) = stage.teacher.roster.examples
    assert example.seconds == pytest.approx(1.0, abs=0.1)
    stage.wait(1.0)
    stage.stand(1.0)
    stage.teacher.named.push(_event(EventKind.START, 105.5))
    stage.stand(0.5)
    stage.ask(commands.Wrong())
    assert stage.teacher.roster.examples[1].seconds == pytest.approx(1.5, abs=0.1)
    stage.wait(1.0)
    stage.stand(0.5)
    stage.ask(commands.Undo())
    stage.ask(commands.Wrong())
    assert stage.teacher.roster.examples[1].seconds == pytest.approx(1.5, abs=0.1)


def test_without_a_named_motion_nothing_is_taken() -> None:
    """Nobody was named, or somebody else, or somebody who has left."""
    stage = Stage()
    stage.stand(1.0)
    for performer in ("", "ann", "bob"):
        assert stage.ask(commands.Right(performer)) == [State(performer, Step.REFUSED, 0.0, "no motion was named")]
    _performed(stage)
    stage.wait(6.0)
    stage.ask(commands.Right("ann"))
    assert stage.reason() == "no motion was named"
    assert stage.teacher.roster.examples == ()


def test_a_person_speaks_of_the_motion_that_there_was_time_to_see() -> None:
    """A motion that has begun just now is not meant; nor is the time of the motion before part of a motion."""
    named = NamedMotions()
    assert named.meant("ann", 1.0) is None
    named.push(_event(EventKind.START, 1.0, "squat"))
    named.push(_event(EventKind.END, 2.0, "squat"))
    named.push(_event(EventKind.START, 2.2, "kick"))
    named.push(_event(EventKind.END, 2.3, "squat"))
    before, now = named.meant("ann", 2.5), named.meant("ann", 3.0)
    assert (before.class_name, before.span(2.5)) == ("squat", pytest.approx((0.2, 2.0)))
    assert (now.class_name, now.span(3.0)) == ("kick", (2.0, 3.0))
    assert now.span(30.0) == (15.0, 30.0)
    named.push(_event(EventKind.START, 9.0, "wave", "bob"))
    assert [named.last(asked, {"ann", "bob"}) for asked in ("", "ann", "cy")] == ["bob", "ann", None]
    named.forget("bob")
    assert named.last("", {"ann", "bob"}) == "ann"
