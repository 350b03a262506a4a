"""Answers as streams of the lab streaming layer (LSL): events as markers, and each performer's scores as floats."""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

from kinespace.stream.outputs.sink import Sink, extra
from kinespace.stream.recognition import Done, Event, Gone, Recognition

#: The name among the layouts of `--out`.
LSL = "lsl"
#: The names of the streams.
EVENTS, SCORES = "kinespace-events", "kinespace-{}"
#: The channels behind the classes' scores; phase, speed and amplitude are 0 where no motion is followed.
FURTHER = ("class", "margin", "phase", "speed", "amplitude")
#: Where LSL looks for its settings.
_SETTINGS = Path("lsl_api.cfg"), Path("~/lsl_api/lsl_api.cfg"), Path("/etc/lsl_api/lsl_api.cfg")
#: Performers whose scores have a stream, at most.
_MAX_STREAMS = 256


def lsl() -> ModuleType:
    """Load pylsl. Its library's greeting stays away, unless a file of LSL's settings would be passed over by that.

    Raises
    ------
    ImportError
        pylsl is not there.
    """
    loaded = extra("pylsl", LSL)
    if "LSLAPICFG" not in os.environ and not any(place.expanduser().exists() for place in _SETTINGS):
        # Older ones cannot be told.
        with suppress(AttributeError, RuntimeError):
            loaded.set_config_content("[log]\nlevel = -1\n")
    return loaded


class LslSink(Sink):
    """Gives answers to all programs that look for them on the network by LSL, in LSL's own time.

    `kinespace-events` has a text for each event: `start squat1Reps ann`, `end squat1Reps ann`, and for a motion that
    was done `done squat1Reps ann`. It is stamped with the time of the event, as far before the newest answer as by the
    sender's clock. `kinespace-ann` has a number for each class, its score, and `FURTHER`; the class is its index, -1
    for none.
    """

    def __init__(self) -> None:
        self._lsl = lsl()
        info = self._lsl.StreamInfo(EVENTS, "Markers", 1, self._lsl.IRREGULAR_RATE, "string", EVENTS)
        self._events = self._lsl.StreamOutlet(info)
        #: The classes and the stream of each performer, and the time of the newest answer by the sender's clock.
        self._streams: dict[str, tuple[Sequence[str], Any]] = {}
        self._newest: dict[str, float] = {}

    def __str__(self) -> str:
        return "LSL"

    def publish_recognition(self, recognition: Recognition) -> None:
        """Give a performer's scores, progress and class."""
        name = recognition.performer
        classes, stream = self._streams.get(name, ((), None))
        if stream is None or classes != recognition.classes:
            stream = self._opened(name, recognition.classes)
        self._newest[name] = recognition.time
        further = (float(recognition.class_index), recognition.margin, *recognition.followed)
        stream.push_sample([*map(float, recognition.scores), *further])

    def _opened(self, name: str, classes: Sequence[str]) -> Any:  # noqa: ANN401 - pylsl's class, which is an extra's
        """Open the stream of a performer, or open it again for other classes."""
        if name not in self._streams and len(self._streams) >= _MAX_STREAMS:
            self.publish_gone(Gone(next(iter(self._streams))))
        title, labels = SCORES.format(name), [*classes, *FURTHER]
        info = self._lsl.StreamInfo(title, "Scores", len(labels), self._lsl.IRREGULAR_RATE, "float32", title)
        info.set_channel_labels(labels)
        # The stream before ends first: two of one name would be mixed up.
        self._streams.pop(name, None)
        stream = self._lsl.StreamOutlet(info)
        self._streams[name] = classes, stream
        return stream

    def publish_event(self, event: Event) -> None:
        """Give a marker."""
        self._mark(f"{event.kind} {event.label} {event.performer}", event.performer, event.time)

    def publish_done(self, done: Done) -> None:
        """Give a marker at the end of the motion that was done."""
        self._mark(f"done {done.label} {done.performer}", done.performer, done.start + done.duration)

    def publish_gone(self, gone: Gone) -> None:
        """Close the performer's stream."""
        self._streams.pop(gone.performer, None)
        self._newest.pop(gone.performer, None)

    def _mark(self, text: str, performer: str, time: float) -> None:
        before = max(self._newest.get(performer, time) - time, 0.0)
        self._events.push_sample([text], self._lsl.local_clock() - before)

    def close(self) -> None:
        """Close all streams."""
        self._streams.clear()
        del self._events
