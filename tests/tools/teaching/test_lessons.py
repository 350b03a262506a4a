import errno
import json
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import zmq
from fakes import FakeSink
from programs import PATIENCE, motions_of, two_of_each, until

from kinespace.library import Clip, MotionLibrary, Skeleton, WindowIndex, library_file
from kinespace.stream import Announcement, Event, EventKind, Frame, Performers, Recognition, Settings
from kinespace.stream.frame import Admitted
from kinespace.stream.inputs import commands as requests
from kinespace.stream.inputs.commands import RequestSource
from kinespace.stream.recognizer import SentJoints
from kinespace.stream.teaching import Asked, Command, Notice, State, Step, Taught, Teacher, commands
from kinespace.stream.teaching.commands import Tried
from kinespace.stream.teaching.examples import Example, Roster, TaughtWindows
from kinespace.stream.zeromq import Endpoint
from kinespace.tools.cli.console import require_place_for
from kinespace.tools.teaching import lessons
from kinespace.tools.teaching.keys import HINT, Keys
from kinespace.tools.teaching.lessons import Change, ClassPlaces, RosterOpener, open_lessons
from kinespace.tools.teaching.roster_file import RosterFile

#: Endings of the names of joints that a body of 20 joints lacks.
FURTHER_JOINTS = ("fingers", "thumb", "wrist", "clavicle", "upperback", "upperneck", "thorax")


@pytest.fixture(scope="module")
def library() -> MotionLibrary:
    """Give two motions of each of three classes by each of three persons, which are opened quickly."""
    few = two_of_each(("squat1Reps", "kickLFront1Reps", "grabHighR"), ("bk", "dg", "mm"))
    return replace(MotionLibrary.builtin(), motions=few)


class Stage:
    """The recognisers, the lessons and one listener, as a service holds them."""

    def __init__(self, file: Path, library: MotionLibrary | None) -> None:
        def performers(index: WindowIndex, classes: Sequence[str]) -> Performers:
            return Performers(index, classes=classes, joints=SentJoints())

        self.lessons, self.heard = open_lessons(file, library, (), performers), FakeSink()
        self.lessons.sinks = [self.heard]

    def push(self, event: Admitted) -> Recognition | None:
        """Recognise a frame, show it to the teacher, and give the answer if performers are answered."""
        (answer,) = self.lessons.performers.push_all([event], time.monotonic())
        if isinstance(event, Frame):
            self.lessons.send(event)
        return answer if self.lessons.answers else None

    def command(self, command: Command) -> list[State]:
        """Carry out a command."""
        return self.lessons.carry_out(Asked(command))

    def until(self, enough: Callable[[FakeSink], bool]) -> FakeSink:
        """Wait until the listener has heard enough."""
        until(lambda: (self.lessons.tend(time.monotonic()), enough(self.heard))[1])
        return self.heard


@pytest.fixture
def stage(tmp_path: Path, library: MotionLibrary) -> Iterator[Stage]:
    """Open lessons whose library is kept in a file."""
    stage = Stage(tmp_path / "mine.npz", library)
    yield stage
    stage.lessons.close()


def _show(stage: Stage, begin: float, class_name: str, take: int = 0, joints: Sequence[int] = range(31)) -> list[str]:
    """Show a motion between stillnesses by some joints; give the classes that started."""
    motion = motions_of(class_name)[take].positions
    shown = [each[joints] for each in (*[motion[0]] * 60, *motion, *[motion[-1]] * 60)]
    answers = [stage.push(Frame("ann", begin + place / 60, each)) for place, each in enumerate(shown)]
    return [event.label for each in answers if each for event in each.events if event.kind == "start"]


def _teach(stage: Stage, begin: float, name: str, class_name: str, joints: Sequence[int] = range(31)) -> None:
    """Show an example, and wait until it is taught."""
    # On a busy machine the last frames may be old: the performer who is taught must be present.
    stand = MotionLibrary.builtin().motions[0].positions[0][joints]
    for place in range(10):
        stage.push(Frame("ann", begin - 1 + place / 60, stand))
    done = stage.heard.steps().count(Step.DONE)
    stage.command(commands.Teach("ann", name, 1, 0.0))
    stage.lessons.tend(time.monotonic())
    _show(stage, begin, class_name, 0, joints)
    stage.until(lambda heard: heard.steps().count(Step.DONE) > done)


@pytest.mark.slow
def test_a_class_is_taught_recognised_and_saved(stage: Stage, library: MotionLibrary, tmp_path: Path) -> None:
    """It comes behind the classes that were there, starts when it is shown, is in the file and there the next time."""
    _show(stage, 0, "kickLFront1Reps")
    _teach(stage, 10, "my squat", "squat1Reps")
    assert stage.lessons.classes == stage.heard.of(tuple)[-1] == (*library.classes, "my squat")
    assert [each.class_name for each in stage.heard.of(Taught)] == ["my squat"]
    assert _show(stage, 20, "squat1Reps", 1)[:1] == ["my squat"]
    stage.command(commands.Rename("my squat", "bend"))
    stage.until(lambda _: stage.lessons.classes[-1] == "bend")
    stage.lessons.close()
    assert MotionLibrary.load(tmp_path / "mine.npz").classes == ("bend",)
    assert stage.lessons.classes == (*library.classes, "bend")
    again = Stage(tmp_path / "mine.npz", library)
    assert again.lessons.classes == stage.lessons.classes
    assert _show(again, 20, "squat1Reps", 1)[:1] == ["bend"]
    again.lessons.close()


@pytest.mark.slow
def test_what_is_taught_is_tried_on_the_last_minutes(stage: Stage) -> None:
    """It says how often it would have been done, its own examples left out; what was wrong is not said again."""
    _show(stage, 0, "squat1Reps", 1)
    _show(stage, 10, "kickLFront1Reps")
    _show(stage, 20, "squat1Reps", 2)
    for begin in (30, 40):
        _teach(stage, begin, "my squat", "squat1Reps")
    first, second = (each.tried for each in stage.heard.of(Taught))
    assert (first.done, second.done) == (2, 2)
    assert (first.seconds, second.seconds) == (pytest.approx(30.0, abs=1.5), pytest.approx(40.0, abs=1.5))
    assert _show(stage, 50, "squat1Reps", 1)[:1] == ["my squat"]
    stage.lessons.send(Event("ann", EventKind.START, "my squat", 0, 0.9, 52.0))
    stage.command(commands.Wrong())
    stage.until(lambda heard: heard.steps().count(Step.DONE) == 3)
    assert stage.heard.of(Notice)[-2] == Taught("nothing", 1, pytest.approx(3.0, abs=1.0), "good", Tried())
    assert "my squat" not in _show(stage, 60, "squat1Reps", 1)


@pytest.mark.slow
def test_nothing_alone_is_no_library(tmp_path: Path) -> None:
    """Taught first, without a library, it answers nobody, also the next time; behind it a gesture is known."""
    stage = Stage(tmp_path / "mine.npz", None)
    _teach(stage, 0, "nothing", "kickLFront1Reps")
    assert (_show(stage, 20, "kickLFront1Reps"), stage.lessons.answers, stage.lessons.classes) == ([], False, ())
    stage.lessons.close()
    with pytest.raises(ValueError, match="library: expected a class besides 'nothing', got none"):
        Performers(MotionLibrary.load(tmp_path / "mine.npz"))
    again = Stage(tmp_path / "mine.npz", None)
    assert (_show(again, 0, "kickLFront1Reps"), again.lessons.answers) == ([], False)
    _teach(again, 20, "my squat", "squat1Reps")
    assert _show(again, 40, "squat1Reps", 1)[:1] == ["my squat"]
    again.lessons.close()


@pytest.mark.slow
def test_nothing_that_holds_a_gesture_is_told(tmp_path: Path) -> None:
    """Other movement is good; the gesture itself would never be named again."""
    stage = Stage(tmp_path / "mine.npz", None)
    shown = [("my squat", "squat1Reps"), ("nothing", "kickLFront1Reps"), ("nothing", "squat1Reps")]
    for count, (name, class_name) in enumerate(shown, start=1):
        _teach(stage, 20 * count, name, class_name)
    _, good, bad = (each.words for each in stage.heard.of(Taught))
    assert (good, bad) == ("good", told := "my squat is in it: undo it, and move without your gestures")
    stage.command(commands.Undo())
    stage.lessons.close()
    again = Stage(tmp_path / "mine.npz", None)
    _teach(again, 20, "nothing", "squat1Reps")
    assert [each.words for each in again.heard.of(Taught)] == [told]
    again.lessons.close()


@pytest.mark.slow
def test_nothing_that_comes_with_a_gesture_is_told_if_it_holds_it(tmp_path: Path) -> None:
    """While the first example is opened the others wait, and are opened together."""
    stage = Stage(tmp_path / "mine.npz", None)
    _show(stage, 0, "kickLFront1Reps")
    _show(stage, 10, "squat1Reps")
    for name, ago in (("kick", 6.0), ("my squat", 0.0), ("nothing", 0.0)):
        stage.command(commands.Last("ann", 8.0 if ago else 5.0, name, ago))
    stage.until(lambda heard: len(heard.of(Taught)) == 3)
    assert "is in it" in stage.heard.of(Taught)[-1].words
    stage.lessons.close()


@pytest.mark.slow
def test_a_busy_machine_tries_a_part(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """The word comes, with the seconds on which it was tried."""
    monkeypatch.setattr(lessons, "_TRIED_FOR", 0.0)
    _show(stage, 0, "squat1Reps", 1)
    _teach(stage, 10, "my squat", "squat1Reps")
    (taught,) = stage.heard.of(Taught)
    assert 0.0 < taught.tried.seconds < 1.0
    assert taught.tried.words == "done not once in 0 s of your movement before"


@pytest.mark.slow
def test_a_full_disk_loses_nothing(stage: Stage, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A failure to save is reported; the class is known all the same."""
    write = library_file.write

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(library_file, "write", full)
    _show(stage, 0, "kickLFront1Reps")
    _teach(stage, 10, "my squat", "squat1Reps")
    heard = stage.until(lambda heard: Step.REFUSED in heard.steps())
    told = [each.reason for each in heard.of(State) if each.step is Step.REFUSED]
    assert told == ["mine.npz was not saved: No space left on device; the taught motions are still in memory"]
    assert _show(stage, 20, "squat1Reps", 1)[:1] == ["my squat"]
    assert stage.lessons.has_unsaved
    # When there is room again, it is saved without being asked, and said.
    (tmp_path / "far").mkdir()
    (tmp_path / "mine.npz").symlink_to(tmp_path / "far" / "mine.npz")
    monkeypatch.setattr(library_file, "write", write)
    stage.until(lambda heard: State("", Step.DONE, 0.0, "mine.npz saved, examples: 1") in heard.of(State))
    assert not stage.lessons.has_unsaved
    assert (tmp_path / "mine.npz").is_symlink()


def test_a_performer_who_is_taught_fires_nothing(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the countdown until a motion shown last cannot be said any more, unless lessons are to be loud."""
    _show(stage, 0, "kickLFront1Reps")
    now = time.monotonic()
    monkeypatch.setattr(stage.lessons, "_clock", lambda: now)
    assert stage.lessons.muted == ""
    for loud, muted in ((True, ""), (False, "ann")):
        stage.lessons.is_loud = loud
        stage.command(commands.Teach("", "wave"))
        assert stage.lessons.muted == muted
        stage.command(commands.Cancel())
        now += 0.4
        assert stage.lessons.muted == muted
    now += 0.2
    assert stage.lessons.muted == ""


class Slow(TaughtWindows):
    """Opens a roster while `may_end` is set; refuses an example of the number 13."""

    def __init__(self) -> None:
        super().__init__(None, with_base=False)
        self.opened, self.may_end = list[int](), threading.Event()

    def index_of(self, roster: Roster) -> None:  # type: ignore[override]
        """Note the number of examples."""
        self.opened.append(len(roster.examples))
        assert self.may_end.wait(PATIENCE)
        if any(each.number == 13 for each in roster.examples):
            raise ValueError("a body that does not move")


def _growing(numbers: Sequence[int]) -> list[Change]:
    motion = MotionLibrary.builtin().motions[0]
    examples = tuple(Example(number, "bow", motion, 0.0, 1.0) for number in numbers)
    return [Change(Roster(examples[: count + 1]), Settings(), number) for count, number in enumerate(numbers)]


def test_an_example_that_cannot_be_compared_takes_no_other_with_it() -> None:
    """Of several that came together it alone is refused."""
    windows, changes = Slow(), _growing([11, 12, 13, 14])
    teacher = Teacher(changes[0].roster.examples[0].recording.skeleton, changes[-1].roster)
    opener = RosterOpener(windows, teacher, lambda *_: ())
    for change in changes:
        opener.open(change)
    windows.may_end.set()
    notices = list[object]()
    until(lambda: (notices.extend(opener.results()), 3 in windows.opened[4:] or len(windows.opened) >= 6)[1])
    opener.close()
    notices += opener.results()
    refused = [each.reason for each in notices if isinstance(each, State) and each.step is Step.REFUSED]
    assert refused == ["a body that does not move"]
    assert [each.number for each in teacher.roster.examples] == [11, 12, 14]


def test_indices_stay() -> None:
    """A start sorts; a class that is forgotten or renamed keeps its place; a new one comes last."""
    motion = MotionLibrary.builtin().motions[0]

    def roster(**names: str) -> Roster:
        return Roster(tuple(Example(int(key[1:]), name, motion, 0, 1) for key, name in names.items()))

    places = ClassPlaces(["base"])
    assert places.of(roster(e1="b", e2="a")) == ("base", "a", "b")
    assert places.of(roster(e2="a")) == ("base", "a", "b")
    assert places.of(roster(e2="z")) == ("base", "z", "b")
    assert places.of(roster(e2="a")) == ("base", "a", "b")
    assert places.of(roster(e2="a", e3="nothing", e4="c")) == ("base", "a", "b", "c")
    assert places.of(roster(e4="a")) == ("base", "a", "b", "c")


@pytest.mark.slow
@pytest.mark.parametrize("beside", [True, False])
def test_a_performer_with_fewer_joints_is_taught(beside: bool, library: MotionLibrary, tmp_path: Path) -> None:  # noqa: FBT001
    """Of 31 joints a performer has 20: what he is taught is recognised by these."""
    stage = Stage(tmp_path / "mine.npz", library if beside else None)
    kept = [place for place, name in enumerate(library.skeleton.joints) if not name.endswith(FURTHER_JOINTS)]
    assert len(kept) == 20
    stage.push(Announcement("ann", tuple(library.skeleton.joints[place] for place in reversed(kept))))
    _teach(stage, 10, "my squat", "squat1Reps", kept[::-1])
    _teach(stage, 20, "my kick", "kickLFront1Reps", kept[::-1])
    assert _show(stage, 30, "squat1Reps", 1, kept[::-1])[:1] == ["my squat"]
    stage.lessons.close()
    saved = MotionLibrary.load(tmp_path / "mine.npz").motions[0]
    places = [saved.skeleton.joints.index(name) for name in ("lhand", "lfingers")]
    assert np.array_equal(*saved.positions[:, places].swapaxes(0, 1))


def test_a_performer_whose_joints_cannot_be_compared_is_told_so(stage: Stage, library: MotionLibrary) -> None:
    """Teaching a performer with too few of the library's joints is refused with the reason."""
    stage.push(Announcement("bob", library.skeleton.joints[:3]))
    for place in range(8):
        stage.push(Frame("bob", place / 60, np.ones((3, 3))))
    for command, told in (
        (commands.Teach("bob", "wave"), "3 joints, 3 of them among the 31 compared"),
        (commands.Teach("nobody", "wave"), "nobody is there: no frames come"),
    ):
        (state,) = stage.command(command)
        assert state.step is Step.REFUSED
        assert state.reason.startswith(told)


@pytest.mark.parametrize("may", [True, False])
def test_a_stranger_at_the_control_learns_nothing(
    may: bool,  # noqa: FBT001
    tmp_path: Path,
    library: MotionLibrary,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A sender that may command learns the classes; another one only that it may not."""
    monkeypatch.setattr(requests, "may_command", lambda *_: may)
    stage = Stage(tmp_path / "t.npz", library)
    control = RequestSource(Endpoint("tcp://127.0.0.1:*", bind=True), ())
    with closing(control), zmq.Context() as context, context.socket(zmq.REQ) as asking:
        asking.linger = 0
        asking.connect(control.address)
        asking.send(b'{"do":"list"}')
        stage.lessons.carry_out((until(lambda: control.take(0.0)) or ())[0])
        reply = json.loads(asking.recv())
    assert ("classes" in reply, len(reply) == 1) == (may, not may)
    assert control.counts.foreign == (not may)
    stage.lessons.close()


def _keys(*classes: str, asked: Callable[[Asked], object] = print) -> tuple[Keys, SimpleNamespace, SimpleNamespace]:
    """Give the keys of a program, what they read of its lessons, and its table."""
    lessons = SimpleNamespace(classes=[*classes], performers=SimpleNamespace(names=("ann", "bob")))
    shown = SimpleNamespace(hint=HINT)
    return Keys(lessons, shown, asked), lessons, shown  # type: ignore[arg-type]  # as read


def test_the_commands_of_keys() -> None:
    """New motions are numbered, held ones too; the last name was right, or wrong; a number chooses who is taught."""
    keys, lessons, shown = _keys("squat", "motion 1")
    assert keys.command_of("t") == commands.Teach("", "motion 2")
    lessons.classes.append("motion 2")
    assert keys.command_of("a") == commands.Teach("", "motion 2")
    held = [keys.command_of("h") for _ in range(2)]
    assert held == [commands.Hold("", "motion 3"), commands.Hold("", "motion 3", on=False)]
    asked = [commands.Right(), commands.Wrong(), commands.Teach("", "nothing"), commands.Undo(), None, None]
    assert [keys.command_of(key) for key in "ynmu?9²"] == [*asked, None]
    assert keys.command_of("2") is None
    assert shown.hint.startswith("bob is taught")
    assert keys.command_of("n") == commands.Wrong("bob")
    assert keys.command_of("a") == commands.Teach("bob", "motion 3")


@pytest.mark.skipif(sys.platform == "win32", reason="no such terminals")
def test_keys_that_come_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """All of a pasted text are keys at once, and bytes that are no letters stop none of them."""
    import pty  # noqa: PLC0415 - only on systems with such terminals
    import termios  # noqa: PLC0415 - as above

    asked = list[Asked]()
    keyboard, terminal = pty.openpty()
    with os.fdopen(keyboard, "wb", 0) as hands, os.fdopen(terminal, encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        with _keys(asked=asked.append)[0]:
            # Until then whatever is typed is thrown away.
            until(lambda: not termios.tcgetattr(terminal)[3] & termios.ICANON)
            hands.write(b"t\xff=" + "wéve\n".encode())
            until(lambda: len(asked) == 2)
    assert [each.command for each in asked] == [commands.Teach("", "motion 1"), commands.Rename("motion 1", "wéve")]


def test_a_motion_is_named_by_keys() -> None:
    """Letters are its name until Enter, then examples go on by it; Escape leaves the old one."""
    keys, _, shown = _keys("motion 1")
    assert keys.command_of("=") is None
    keys.command_of("t")
    assert [keys.command_of(key) for key in "=hix\x7f t"] == [None] * 7
    assert shown.hint == "motion 2 is called: hi t"
    assert keys.command_of("\n") == commands.Rename("motion 2", "hi t")
    assert (shown.hint, keys.command_of("a")) == (HINT, commands.Teach("", "hi t"))
    assert [keys.command_of(key) for key in "=x\x1b"] == [None] * 3
    assert keys.command_of("a") == commands.Teach("", "hi t")


# --- the file of a roster ---------------------------------------------------------------------------------------------


@pytest.fixture
def motion() -> Clip:
    """Give a short motion."""
    return MotionLibrary.builtin().motions[0]


def _roster(motion: Clip, *classes: str) -> Roster:
    return Roster(tuple(Example(place, name, motion, 0.0, 0.5) for place, name in enumerate(classes, start=1)))


def _saved(path: Path, roster: Roster) -> MotionLibrary:
    with closing(RosterFile(path)) as file:
        file.save(roster)
    return MotionLibrary.load(path)


def test_the_newest_roster_is_saved_at_the_end(tmp_path: Path, motion: Clip, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand changes that pour in while one is saved are one further save, and the last one is in the file."""
    file, write = RosterFile(tmp_path / "mine.npz"), library_file.write
    saved, poured_in = list[str](), threading.Event()

    def slowly(path: Path, contents: library_file.Contents) -> None:
        saved.append(contents[1][0].class_name)
        assert poured_in.wait(PATIENCE)
        write(path, contents)

    monkeypatch.setattr(library_file, "write", slowly)
    for count in range(1, 1001):
        file.save(_roster(motion, f"class {count}"))
    poured_in.set()
    file.close()
    assert not file.has_unsaved
    assert len(saved) <= 2
    assert MotionLibrary.load(tmp_path / "mine.npz").classes == ("class 1000",)
    assert sorted(each.name for each in tmp_path.iterdir()) == [".mine.npz.lock", "mine.npz"]


def test_what_cannot_be_deleted_is_tried_again(tmp_path: Path, motion: Clip, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread that writes goes on when the file of new examples cannot be deleted, and all is written later."""
    file, unlink, refused = RosterFile(tmp_path / "mine.npz"), Path.unlink, list[Path]()

    def unwilling(path: Path, missing_ok: bool = False) -> None:  # noqa: FBT001, FBT002 - as Path's own
        if path.name.endswith(".new") and not refused:
            refused.append(path)
            raise PermissionError(errno.EACCES, "Permission denied")
        unlink(path, missing_ok=missing_ok)

    monkeypatch.setattr(Path, "unlink", unwilling)
    file.save(_roster(motion, "first"), asked=True)
    file.close()
    assert refused
    assert [state.step for state in file.states()] == [Step.REFUSED, Step.DONE]
    assert MotionLibrary.load(tmp_path / "mine.npz").classes == ("first",)
    assert not file.has_unsaved


def test_a_second_program_is_refused(tmp_path: Path, motion: Clip) -> None:
    """One file is taught by one program at a time, also by way of a link; afterwards by another."""
    path = tmp_path / "mine.npz"
    (tmp_path / "link.npz").symlink_to(path)
    with closing(RosterFile(path)) as file:
        for name in ("mine.npz", "link.npz"):
            with pytest.raises(ValueError, match=f"{name}: another kinespace teaches there"):
                RosterFile(tmp_path / name)
        file.save(_roster(motion, "bow"))
    assert _saved(tmp_path / "link.npz", _roster(motion, "bow", "wave")).classes == ("bow", "wave")
    assert (tmp_path / "link.npz").is_symlink()


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such lock")
@pytest.mark.parametrize("kind", ["link", "dangling link", "pipe", "folder"])
def test_whatever_lies_where_the_lock_is_to_be_stays_as_it_is(tmp_path: Path, kind: str) -> None:
    """In a folder where others write: nothing is followed, waited for, emptied or deleted; no program starts."""
    lock, important = tmp_path / ".mine.npz.lock", tmp_path / "important.txt"
    important.write_text("text", encoding="utf-8")
    if kind == "pipe":
        os.mkfifo(lock)
    elif kind == "folder":
        lock.mkdir()
    else:
        lock.symlink_to(important if kind == "link" else tmp_path / "nothing")
    with pytest.raises((OSError, ValueError), match=r"mine\.npz\.lock"):
        RosterFile(tmp_path / "mine.npz")
    assert important.read_text(encoding="utf-8") == "text"
    assert lock.is_symlink() or lock.exists()
    assert not (tmp_path / "nothing").exists()
    # An important file of another name is not emptied, either.
    lock.rmdir() if kind == "folder" else lock.unlink()
    os.link(important, lock)
    RosterFile(tmp_path / "mine.npz").close()
    assert important.read_text(encoding="utf-8") == "text"


def test_other_programs_that_write_a_library_ask_the_lock(tmp_path: Path, motion: Clip) -> None:
    """`build` and `learn` save a library, and every program looks first whether its output has room."""
    path, other = tmp_path / "mine.npz", MotionLibrary.of_clips([replace(motion, class_name="built")])
    with closing(RosterFile(path)) as file:
        file.save(_roster(motion, "bow"))
        with pytest.raises(ValueError, match=r"mine\.npz: another kinespace teaches there"):
            other.save(path)
        with pytest.raises(ValueError, match=r"mine\.npz: another kinespace teaches there"):
            require_place_for(path)
    assert MotionLibrary.load(path).classes == ("bow",)
    other.save(path)
    assert MotionLibrary.load(path).classes == ("built",)


def test_new_examples_survive_an_unwritten_file(tmp_path: Path, motion: Clip, monkeypatch: pytest.MonkeyPatch) -> None:
    """They lie beside the file, readers find them, and they come into it when it is quiet, or with another change."""
    path, new = tmp_path / "mine.npz", tmp_path / ".mine.npz.new"
    _saved(path, _roster(motion, "bow", "wave"))
    file = RosterFile(path)
    roster, content = Roster.of_library(file.library), path.read_bytes()
    for number in range(3, 8):
        roster = roster.with_example(Example(number, f"kick {number}", motion, 0.0, 0.5))
        file.save(roster)
    until(lambda: not file.has_unsaved)
    assert path.read_bytes() == content
    assert len(MotionLibrary.load(path)) == 7
    # As a program is killed: the next one finds all, and puts them into the file.
    copied = tmp_path / "elsewhere"
    copied.mkdir()
    for each in (path, new):
        shutil.copy(each, copied / each.name)
    with closing(RosterFile(copied / "mine.npz")) as again:
        assert sorted(each.take for each in again.library.motions) == [f"{number:04d}" for number in range(1, 8)]
        assert not (copied / ".mine.npz.new").exists()
        assert len(MotionLibrary.load(copied / "mine.npz")) == 7
    file.save(roster.renamed("bow", "dip"))
    until(lambda: not file.has_unsaved and not new.exists())
    assert "dip" in MotionLibrary.load(path).classes
    monkeypatch.setattr("kinespace.tools.teaching.roster_file._QUIET", 0.0)
    file.save(roster.renamed("bow", "dip").with_example(Example(8, "bow", motion, 0.0, 0.5)))
    until(lambda: path.read_bytes() != content and not new.exists())
    file.close()
    assert len(MotionLibrary.load(path)) == 8
    # What is in both counts once: a program was killed in between.
    shutil.copy(path, new)
    assert len(MotionLibrary.load(path)) == 8


@pytest.mark.parametrize("is_at_once", [False, True])
def test_an_undone_example_is_in_no_file(tmp_path: Path, motion: Clip, *, is_at_once: bool) -> None:
    """It lay beside the file, which had all others: it goes at once, and is not there the next time."""
    path, new, roster = tmp_path / "mine.npz", tmp_path / ".mine.npz.new", _roster(motion, "bow")
    with closing(RosterFile(path)) as file:
        file.save(roster, asked=True)
        until(path.exists)
        file.save(roster.with_example(Example(2, "kick", motion, 0.0, 0.5)))
        until(new.exists)
        file.save(roster)
        until(lambda: is_at_once or not new.exists())
    assert len(MotionLibrary.load(path)) == 1


def test_a_file_that_loses_examples_is_kept(tmp_path: Path, motion: Clip) -> None:
    """Forgetting leaves the file as it was beside the new one, and a smaller loss does not take its place."""
    path, before = tmp_path / "mine.npz", tmp_path / "mine.before.npz"
    _saved(path, _roster(motion, "bow", "wave", "kick"))
    with closing(RosterFile(path)) as file:
        file.save(Roster())
    assert not path.exists()
    assert MotionLibrary.load(before).classes == ("bow", "kick", "wave")
    with closing(RosterFile(path)) as file:
        assert file.library is None


@pytest.mark.slow
def test_a_richer_library_keeps_what_is_not_touched(tmp_path: Path, motion: Clip) -> None:
    """Further joints, names, and learned numbers stay; what is undone leaves it as it was."""
    path, builtin = tmp_path / "mine.npz", MotionLibrary.builtin()
    classes = ("squat1Reps", "kickLFront1Reps")
    rich = builtin.without(classes=[name for name in builtin.classes if name not in classes])
    skeleton = Skeleton((*rich.skeleton.joints, "prop"))
    tip = rich.skeleton.joints.index("rhand")
    longer = [np.concatenate([each.positions, each.positions[:, [tip]] + 0.001], 1) for each in rich.motions]
    both = zip(rich.motions, longer, strict=True)
    motions = tuple(replace(each, skeleton=skeleton, positions=positions) for each, positions in both)
    assert rich.learned
    MotionLibrary(skeleton, motions, rich.learned).save(path)
    before = MotionLibrary.load(path)
    bare = Roster.of_library(before.restricted_to(rich.skeleton.joints))
    taught = Example(bare.next_number, "bow", motion, 0.0, 0.5)
    after = _saved(path, bare.renamed("squat1Reps", "dip").with_example(taught))
    assert after.classes == ("bow", "dip", "kickLFront1Reps")
    assert after.skeleton.joints == skeleton.joints
    kept = {each.name: each for each in after.motions if each.class_name != "bow"}
    assert kept.keys() == {each.name for each in before.motions}
    for old in before.motions:
        assert np.array_equal(old.positions, kept[old.name].positions)
        assert old.take == kept[old.name].take
    (bow,) = (each for each in after.motions if each.class_name == "bow")
    assert np.array_equal(bow.positions[:, -1], bow.positions[:, tip])
    assert {*after.learned} == {*library_file.for_other_motions(before.learned)}
    before.save(path)
    assert {*_saved(path, bare).learned} == {*before.learned}
