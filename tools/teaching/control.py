"""Control: the commands of a running service. Recordings begin and end; lessons go on where people may teach."""

from __future__ import annotations

import queue
import time
from typing import TYPE_CHECKING

from kinespace.stream.outputs.sink import Sink
from kinespace.stream.teaching import Exchanged, State, Step, commands

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from kinespace.stream.frame import Frame
    from kinespace.stream.inputs.recording.recorder import RecordingSession
    from kinespace.stream.teaching import Asked, Notice
    from kinespace.tools.teaching.lessons import Lessons


class Control(Sink):
    """Carries out commands, and hears frames as every sink does.

    Parameters
    ----------
    lessons
        The lessons; None where nobody may teach.
    clock
        Seconds.

    Attributes
    ----------
    lessons
        As given.
    sinks
        The sinks for notices, for the classes when they change, and for the ends of motions whose class is gone.
    recording
        Begins and ends recordings; None without a folder for them.
    """

    def __init__(self, lessons: Lessons | None = None, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.lessons, self._clock = lessons, clock
        self.sinks: Sequence[Sink] = ()
        self.recording: RecordingSession | None = None
        self._waiting: queue.SimpleQueue[Asked] = queue.SimpleQueue()

    @property
    def answers(self) -> bool:
        """Whether performers are answered."""
        return self.lessons is None or self.lessons.answers

    @property
    def classes(self) -> tuple[str, ...] | None:
        """The classes that are answered; None for the recognisers' own."""
        return self.lessons.classes if self.lessons else None

    def publish_frame(self, frame: Frame) -> None:
        """Show the teacher a frame."""
        if self.lessons:
            self._publish(self.lessons.push(frame, self._clock()))

    def carry_out(self, asked: Asked) -> list[State]:
        """Carry out a command, and reply if a reply is wanted; give the states that follow at once."""
        if asked.command is None:
            notices: Iterable[Notice] = [State("", Step.REFUSED, 0.0, asked.refusal)]
        elif isinstance(asked.command, commands.Record):
            notices = [self._recorded(on=asked.command.on)]
        elif self.lessons:
            notices = self.lessons.command(asked.command, self._clock())
        else:
            notices = [State("", Step.REFUSED, 0.0, "teaching is off: start live with --teach FILE")]
        states = [notice for notice in self._publish(notices) if isinstance(notice, State)]
        if asked.reply:
            asked.reply(states, self.described())
        return states

    def ask(self, asked: Asked) -> None:
        """Carry out, at the next turn, a command from another thread."""
        self._waiting.put(asked)

    def described(self) -> dict[str, object]:
        """Describe the classes, the settings and the recording, for a reply."""
        recording = self.recording.name if self.recording else ""
        lessons = self.lessons.described() if self.lessons else {}
        return {**lessons, "records": self.recording is not None, "recording": recording}

    def tend(self, now: float) -> None:
        """Do the work that is due by the clock."""
        while not self._waiting.empty():
            self.carry_out(self._waiting.get())
        if self.lessons:
            self._publish(self.lessons.tick(now))

    def close(self) -> None:
        """End the recording; save the last changes."""
        if self.recording:
            self.recording.stop()
        if self.lessons:
            self.lessons.close()
            self.tend(self._clock())

    def _publish(self, notices: Iterable[Notice]) -> list[Notice]:
        """Pass notices on as they come; give them."""
        published = []
        for notice in notices:
            published.append(notice)
            for sink in self.sinks:
                if not isinstance(notice, Exchanged):
                    sink.publish_notice(notice)
                    continue
                for ended in notice.ended:
                    sink.publish_event(ended)
                sink.publish_classes(notice.classes)
        return published

    def _recorded(self, *, on: bool) -> State:
        """Begin or end a recording; give its notice."""
        session = self.recording
        if session is None:
            return State("", Step.REFUSED, 0.0, "there is no folder for recordings: start live with --recordings DIR")
        try:
            name = session.start() if on else session.stop()
        except OSError as error:
            return State("", Step.REFUSED, 0.0, f"cannot record: {error.strerror}")
        return State("", Step.DONE, 0.0, f"recording {name}" if on else f"recorded {name}" if name else "not recording")
