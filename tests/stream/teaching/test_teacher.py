import json
from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic import stick_clip

from kinespace.library import MotionLibrary
from kinespace.stream import Event, EventKind, Frame
from kinespace.stream.osc import decode_packet, encode_message
from kinespace.stream.osc.packet import encode_bundle
from kinespace.stream.teaching import Changed, Command, Notice, State, Step, Taught, Teacher, commands
from kinespace.stream.teaching.commands import CommandError, Tried
from kinespace.stream.teaching.examples import Check, Roster
from kinespace.stream.teaching.teacher import AT_WILL, MAX_RECORDING, NamedMotions, RecentFrames

RATE = 60.0


class Stage:
    """One performer before a teacher; time goes by with the frames."""

    def __init__(self, roster: Roster | None = None) -> None:
        self.library = MotionLibrary.builtin()
        self.teacher = Teacher(self.library.skeleton, roster or Roster(), self.library.classes)
        self.now, self.behind, self.told = 0.0, 0.0, list[Notice]()

    def show(self, frames: Iterable[NDArray[np.float64]], rate: float = RATE) -> None:
        """Push frames; their own times are ahead of ours."""
        for positions in frames:
            self.now += 1 / rate
            self.told += self.teacher.push(Frame("ann", 100 + self.now - self.behind, positions), self.now)
            self.told += self.teacher.tick(self.now)

    def stand(self, seconds: float, place: int = 40) -> None:
        """Stand as a motion begins."""
        self.show([self.library.motions[place].positions[0]] * round(seconds * RATE))

    def perform(self, place: int = 40) -> None:
        """Perform a motion and stand still as it ends."""
        positions = self.library.motions[place].positions
        self.show(positions)
        self.show([positions[-1]] * round(RATE))

    def wait(self, seconds: float) -> None:
        """Let time go by without frames."""
        for _ in range(round(seconds * RATE)):
            self.now += 1 / RATE
            self.told += self.teacher.tick(self.now)

    def ask(self, command: Command) -> list[Notice]:
        """Give a command."""
        notices = self.teacher.command(command, self.now)
        self.told += notices
        return notices

    def steps(self) -> list[Step]:
        """List the states told so far."""
        return [each.step for each in self.told if isinstance(each, State)]

    def reason(self) -> str:
        """Give the last state's reason."""
        return next(each.reason for each in reversed(self.told) if isinstance(each, State))


def _asked(class_name: str = "wave", repetitions: int = 1, *, countdown: float = 0.0) -> Stage:
    """Ask for a lesson, after a second of standing."""
    stage = Stage()
    stage.stand(1.0)
    stage.ask(commands.Teach("ann", class_name, repetitions, countdown))
    return stage


def _taught() -> Stage:
    stage = _asked()
    stage.stand(0.5)
    stage.perform()
    return stage


def test_a_lesson_goes_from_countdown_to_check() -> None:
    """Three, two, one; then movement is waited for, recorded until stillness, trimmed, and the library changes."""
    stage = _asked("wave", countdown=3.0)
    stage.stand(3.7)
    stage.perform()
    assert stage.steps() == [*[Step.COUNTDOWN] * 3, Step.WAITING, Step.RECORDING, Step.CHECKING]
    assert [each.seconds for each in stage.told if isinstance(each, State)][:3] == [3.0, 2.0, 1.0]
    (example,) = stage.teacher.roster.examples
    assert example.motion.duration == pytest.approx(stage.library.motions[40].duration, abs=0.35)
    assert example.recording.duration > example.motion.duration + 0.4
    assert "s kept" in stage.reason()
    (changed,) = [each for each in stage.told if isinstance(each, Changed)]
    assert changed.number == 1
    notices = stage.teacher.checked(1, Check(0.3, "squat", float("nan")), Tried(4, 2, 60.0))
    assert notices[0] == Taught("wave", 1, example.seconds, "close to squat", Tried(4, 2, 60.0))
    assert stage.teacher.lesson is None


@pytest.mark.parametrize(("rate", "said"), [(8, "8 frames a second, 10 are better: choose --size lite"), (15, "")])
def test_a_slow_camera_is_said_before_the_lesson(rate: int, said: str) -> None:
    """With the last number of the countdown, while there is time to choose."""
    stage = _asked("wave", countdown=3.0)
    stage.show([stage.library.motions[40].positions[0]] * (3 * rate - 1), rate)
    assert [each.reason for each in stage.told if isinstance(each, State)] == ["", "", said]


def test_an_example_that_is_undone_before_its_check_is_told() -> None:
    """Whoever showed it waits for an end of the lesson."""
    stage = _taught()
    stage.ask(commands.Undo())
    assert stage.teacher.checked(1, None, Tried()) == [State("ann", Step.REFUSED, 0.0, "undone before it was checked")]


def test_undo_without_end() -> None:
    """Every change can be undone."""
    stage = _taught()
    for command in (commands.Rename("wave", "bow"), commands.Enable("squat1Reps", on=False), commands.Forget("bow")):
        stage.ask(command)
    changes = [each for each in stage.told if isinstance(each, State) and each.step is Step.DONE]
    assert [(each.performer, each.seconds) for each in changes] == [("", 0.0)] * 3
    assert [each.reason for each in changes[::2]] == ["wave is bow", "bow forgotten"]
    assert stage.teacher.roster.examples == ()
    rosters = [stage.teacher.roster]
    for _ in range(4):
        stage.ask(commands.Undo())
        rosters.append(stage.teacher.roster)
    assert [[each.class_name for each in roster.examples] for roster in rosters] == [[], ["bow"], ["bow"], ["wave"], []]
    assert rosters[1].disabled == {"squat1Reps"}
    assert stage.reason() == "undone: an example of wave; 0 examples of 0 classes"
    assert stage.ask(commands.Undo())[0] == State("", Step.REFUSED, 0.0, "nothing to undo")


def test_recent_minutes_end_where_the_recording_begins() -> None:
    """The performer's last minutes do not hold the example itself."""
    stage = Stage()
    stage.stand(10.0)
    stage.ask(commands.Teach("ann", "wave", 1, 0.0))
    stage.stand(0.5)
    stage.perform()
    assert stage.teacher.recent(1).clip().duration == pytest.approx(10.3, abs=0.4)
    stage.ask(commands.Teach("ann", "wave", 1, 0.0))
    stage.perform()
    stage.ask(commands.Last("ann", 1.0, "bow"))
    again = stage.teacher.recent(2)
    spans = [(each.start, each.end) for each in again.shown]
    assert len(spans) == 2
    assert spans[0] == pytest.approx((110.2, 112.5), abs=0.5)


def test_a_lesson_without_a_performer_is_refused() -> None:
    """A lesson for an absent performer, or one who leaves, is refused."""
    stage = Stage()
    stage.ask(commands.Teach("", "wave"))
    assert stage.reason() == "nobody is there: no frames come"
    stage.stand(1.0)
    stage.ask(commands.Teach("bo", "wave"))
    assert stage.reason() == "no such performer is there, but ann"
    stage.ask(commands.Teach("ann", "wave", 1, 0.0))
    stage.wait(5.2)
    assert stage.reason() == "the performer has left"
    assert stage.teacher.lesson is None
    stage.ask(commands.Teach("ann", "wave"))
    assert stage.reason() == "nobody is there: no frames come"


def test_who_is_waited_for_sees_how_much_movement_is_needed() -> None:
    """Once a second, as a share; after five seconds the way out is said."""
    stage = _asked()
    stage.stand(6.2)
    waits = [each for each in stage.told if isinstance(each, State)]
    assert {each.step for each in waits} == {Step.WAITING}
    reasons = [each.reason for each in waits]
    assert reasons[:5] == ["", *["movement 0% of what is needed"] * 4]
    assert reasons[5:] == ["movement 0% of what is needed; or show it and ask for /motion/teach/last"] * 2
    body = stage.library.motions[40].positions[0].copy()
    lifted = [body.copy() for _ in range(90)]
    for place, each in enumerate(lifted):
        each[stage.library.skeleton.joints.index("lhand"), 1] += 0.12 * place / 60
    stage.show(lifted)
    found = [int(one.reason.split("%")[0].split()[1]) for one in stage.told if "movement" in getattr(one, "reason", "")]
    assert 10 < max(found) < 100


@pytest.mark.parametrize(("every", "told"), [(12, "5 frames a second show no movement: send 8 or more"), (7, "")])
def test_a_feed_that_is_too_slow_to_show_movement_is_told_so(every: int, told: str) -> None:
    """Five frames a second show none; eight and a half teach."""
    stage = Stage()
    motion = stage.library.motions[0].positions
    stage.ask(commands.Teach("ann", "wave", 1, 0.0))
    for positions in [*[motion[0]] * 60, *motion, *[motion[-1]] * 90][::every]:
        stage.show([positions], RATE / every)
        if stage.teacher.lesson is None and not stage.teacher.roster.examples:
            stage.ask(commands.Teach("ann", "wave", 1, 0.0))
    assert len(stage.teacher.roster.examples) == (not told)
    assert told in {each.reason for each in stage.told if isinstance(each, State)}


def test_a_lesson_of_nothing_records_movement_at_will() -> None:
    """It waits for no movement, no stillness ends it, and all of it is kept; a command may end it sooner."""
    stage = _asked("nothing", countdown=1.0)
    stage.stand(2.0)
    stage.perform()
    stage.stand(AT_WILL)
    assert stage.steps() == [Step.COUNTDOWN, Step.WAITING, Step.RECORDING, Step.CHECKING]
    assert "move as you will for 20 s" in {each.reason for each in stage.told if isinstance(each, State)}
    stage.ask(commands.Teach("ann", "nothing", 1, 0.0))
    stage.perform()
    stage.ask(commands.Stop())
    lasted = stage.library.motions[40].duration + 1
    seconds = [each.seconds for each in stage.teacher.roster.of("nothing")]
    assert seconds == pytest.approx([AT_WILL, lasted], abs=0.1)


def test_a_hole_in_the_feed_makes_no_example() -> None:
    """A recording with missing frames is refused, also of the last seconds; a lesson ends with it."""
    stage = _asked("wave", 2)
    motion = stage.library.motions[40].positions
    stage.show(motion[:60])
    stage.now += 2.0
    stage.show(motion[60:])
    stage.stand(1.0)
    assert (stage.steps()[-1], stage.reason()) == (Step.REFUSED, "frames are missing in the recording")
    stage.ask(commands.Last("ann", 5.0, "wave"))
    assert stage.reason() == "5 s have not been seen"
    assert (stage.teacher.lesson, stage.teacher.roster.examples) == (None, ())


@pytest.mark.parametrize(
    "command",
    [
        *(commands.Rename("squat1Reps", "s"), commands.Forget("squat1Reps"), commands.Enable("nobody", on=True)),
        *(commands.Stop(), commands.Cancel(), commands.Undo(), commands.Last("ann", 3.0, "wave")),
    ],
)
def test_commands_at_the_wrong_step_are_refused(command: Command) -> None:
    """A command that makes no sense at this step is refused with a reason."""
    (told,) = Stage().ask(command)
    assert told.step is Step.REFUSED


def test_an_example_that_cannot_be_compared_is_taken_back() -> None:
    """An example of which no window can be made is taken back with a reason."""
    stage = _taught()
    told, changed = stage.teacher.failed(1, "too short")
    assert told == State("ann", Step.REFUSED, 0.0, "too short")
    assert stage.teacher.roster.examples == ()
    assert changed.roster is stage.teacher.roster


def test_a_feed_with_pauses_is_remembered_for_as_many_seconds_as_any() -> None:
    """Frames that are rare, or a performer who comes and goes, keep no longer a past than a steady feed."""
    stage, recent = Stage(), RecentFrames(MotionLibrary.builtin().skeleton)
    for second in range(400):
        recent.push(float(second), stage.library.motions[0].positions[0], 0.0)
    assert [recent._frames[end][0] for end in (0, -1)] == [99.0, 399.0]  # noqa: SLF001 - unseen


def test_an_example_of_some_seconds_ago_is_the_movement_of_then(sticks: MotionLibrary) -> None:
    """Of two motions the earlier one is taken when its seconds are named, as if asked when it had just ended."""
    bow, wave = stick_clip("bow", seed=70, frames=120), stick_clip("wave", seed=71, frames=120)
    teacher, now, taken = Teacher(sticks.skeleton, Roster()), 0.0, []
    for clip in (bow, wave):
        for positions in clip.positions:
            now += 1 / 60
            teacher.push(Frame("ann", now, positions), now)
        if clip is bow:
            teacher.command(commands.Last("ann", 1.5, "then"), now)
            taken.append(teacher.roster.of("then")[0])
    teacher.command(commands.Last("ann", 1.5, "later", 2.0), now)
    taken.append(teacher.roster.of("later")[0])
    assert taken[1].recording.positions == pytest.approx(taken[0].recording.positions, abs=1e-3)
    assert (taken[1].begin, taken[1].end) == pytest.approx((taken[0].begin, taken[0].end), abs=0.05)


def test_a_held_recording_needs_no_movement() -> None:
    """It begins when it is held and ends when it is released; a lesson that counts down is not ended by a release."""
    stage = Stage()
    stage.stand(1.0)
    assert stage.ask(commands.Hold("ann", "statue")) == [State("ann", Step.RECORDING)]
    stage.stand(1.0)
    stage.ask(commands.Hold("ann", "statue", on=False))
    (example,) = stage.teacher.roster.examples
    assert (example.class_name, example.seconds) == ("statue", pytest.approx(1.0, abs=0.1))
    stage.ask(commands.Teach("ann", "wave"))
    stage.ask(commands.Hold("ann", "statue"))
    assert stage.reason() == "ann is being taught wave"
    stage.ask(commands.Hold("ann", "statue", on=False))
    assert stage.reason() == "nothing was held"
    assert stage.teacher.lesson is not None
    stage.ask(commands.Cancel())
    stage.ask(commands.Hold("", "statue"))
    stage.stand(0.2)
    stage.ask(commands.Hold("", "statue", on=False))
    assert stage.reason() == "expected it to be held for 0.4 s or more"
    stage.ask(commands.Hold("ann", "statue"))
    stage.stand(MAX_RECORDING + 1)
    assert [each.seconds for each in stage.teacher.roster.examples][1:] == [pytest.approx(MAX_RECORDING, abs=0.1)]


def _event(kind: EventKind, time: float, label: str = "squat1Reps", performer: str = "ann") -> Event:
    return Event(performer, kind, label, 0, 0.9, time)


def _performed(stage: Stage, *, going_on: bool = False) -> float:
    """Perform a motion that is named some time after its beginning; give its seconds."""
    stage.stand(2.0)
    began, motion = 100 + stage.now, stage.library.motions[40]
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
    assert stage.reason() == "squat1Reps was wrong"


def test_a_senders_clock_that_begins_again_knows_nothing_of_before() -> None:
    """Neither a lesson before nor a motion that was named before stands in the way of the motions since."""
    stage = _taught()
    _performed(stage)
    stage.behind = stage.now + 95
    stage.stand(1.0)
    assert stage.ask(commands.Wrong("ann"))[0] == State("ann", Step.REFUSED, 0.0, "no motion was named")
    began = 100 + stage.now - stage.behind
    stage.show(stage.library.motions[40].positions)
    stage.teacher.named.push(_event(EventKind.START, began + 0.4))
    stage.stand(0.7)
    stage.ask(commands.Wrong("ann"))
    assert stage.reason() == "squat1Reps was wrong"


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


def test_what_was_named_before_an_example_is_not_meant_behind_it() -> None:
    """The page shows the example's own motion then, and asks about none; undone, the motion before is meant again."""
    stage = Stage()
    _performed(stage)
    stage.ask(commands.Hold("ann", "wave", on=True))
    stage.ask(commands.Cancel())
    for _ in range(2):
        stage.ask(commands.Hold("ann", "wave", on=True))
        stage.show(stage.library.motions[40].positions)
        stage.ask(commands.Hold("ann", "wave", on=False))
        stage.ask(commands.Right("ann"))
        assert stage.reason() == "no motion was named"
        assert [each.class_name for each in stage.teacher.roster.examples] == ["wave"]
        stage.ask(commands.Undo())
    stage.ask(commands.Right("ann"))
    assert [each.class_name for each in stage.teacher.roster.examples] == ["squat1Reps"]


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


# --- commands and notices by OSC and in JSON --------------------------------------------------------------------------


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
        ({"do": "last", "performer": "", "seconds": 2.0, "class": "a", "ago": 5.5}, commands.Last("", 2.0, "a", 5.5)),
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
    tried = f"done 2 times in 3 minutes of your movement before (40 an hour); {TOO_OFTEN}"
    kept = "taught wave: good; examples: 2, 1.2 s kept"
    assert commands.as_line(taught) == f"{kept}; it would have been {tried}"
    assert commands.as_line(Taught("wave", 2, 1.25, "good")) == kept
    would_have = {"would_have_started": 3, "would_have_been_done": 2, "tried_seconds": 180.0, "tried": tried}
    assert commands.as_json(taught) == {"taught": "wave", "examples": 2, "seconds": 1.25, "check": "good"} | would_have


@pytest.mark.parametrize(
    ("tried", "words"),
    [
        (Tried(), ""),
        (Tried(4, 0, 300.0), "done not once in 5 minutes of your movement before"),
        (Tried(0, 0, 42.0), "done not once in 42 s of your movement before"),
        (Tried(0, 1, 42.0), f"done once in 42 s of your movement before; {TOO_OFTEN}"),
    ],
)
def test_how_often_a_class_would_have_been_said(tried: Tried, words: str) -> None:
    """In words, by the hour where it was seen for a minute, and what to do where it is too often."""
    assert tried.words == words
