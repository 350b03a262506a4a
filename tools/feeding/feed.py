"""A fake live feed: frames with the time at which each is sent."""

import math
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kinespace.library import Clip
from kinespace.library.signature.own_frame import at_steps
from kinespace.stream import Announcement, Frame, osc, zeromq
from kinespace.tools.cli.entry import check_interrupted

#: Seconds between two announcements of the skeleton: live senders repeat it for receivers that start later.
ANNOUNCE_EVERY = 1.0

#: Seconds of the longest sleep: the program ends within this time.
_MAX_SLEEP = 0.1

#: A datagram, or the parts of a ZeroMQ message.
Packet = bytes | list[bytes]


@dataclass(frozen=True, slots=True)
class Cue:
    """A frame and when to send it.

    Attributes
    ----------
    due
        Seconds from the feed's start.
    frame
        The frame to send.
    class_name
        The class that is being performed; empty when it is not known.
    recording
        The number of the recording, counted from 0.
    """

    due: float
    frame: Frame
    class_name: str = ""
    recording: int = 0


#: A recording, and the class that is performed at each of its frames; empty where it is not known.
Labelled = tuple[Clip, Sequence[str]]


def clip_cues(clips: Iterable[Clip], performer: str, *, speed: float = 1.0, pause: float = 1.0) -> Iterator[Cue]:
    """Cue clips one after the other.

    Frames have the recordings' own times, so that a feed at another speed gets the same answers.

    Parameters
    ----------
    clips
        In their order.
    performer
        The performer's name in all frames.
    speed
        The factor on the recorded speed.
    pause
        Seconds (of recorded time) between two clips; more than the recogniser's longest gap empties its window.
    """
    recordings = ((clip, [clip.class_name] * clip.frames) for clip in clips)
    return labelled_cues(recordings, performer, speed=speed, pause=pause)


def labelled_cues(
    recordings: Iterable[Labelled], performer: str, *, speed: float = 1.0, pause: float = 1.0
) -> Iterator[Cue]:
    """Cue recordings whose class is known frame by frame, one after the other; parameters as in `clip_cues`."""
    begin = 0.0
    for recording, (clip, classes) in enumerate(recordings):
        for moment, positions, class_name in zip(clip.times.tolist(), clip.positions, classes, strict=True):
            # Time 0 would mean "on arrival".
            frame = Frame(performer, 1.0 + begin + moment, positions)
            yield Cue((begin + moment) / speed, frame, class_name, recording)
        begin += clip.frames / clip.frame_rate + pause


def resampled(clip: Clip, frame_rate: float) -> Clip:
    """Give a clip at another frame rate, over the same seconds, by straight lines between its frames.

    Parameters
    ----------
    clip
        The clip; its rotations are left out.
    frame_rate
        Frames per second.
    """
    if clip.frame_rate == frame_rate:
        return clip
    if clip.frames == 1:
        return replace(clip, frame_rate=frame_rate, rotations=np.zeros((1, 0)))
    # The last time is the last frame's; rounding must not lose it.
    count = int((clip.frames - 1) * frame_rate / clip.frame_rate + 1e-6) + 1
    positions = at_steps(clip.times, clip.positions, np.arange(count) / frame_rate)
    return replace(clip, positions=positions, frame_rate=frame_rate, rotations=np.zeros((count, 0)))


def without_pause(clips: Iterable[Clip], frame_rate: float) -> NDArray[np.float32]:
    """Put clips one after the other, each at another frame rate.

    Returns
    -------
    Positions, shape (frames, joints, 3), metres, in the float32 that goes over the wire.
    """
    return np.concatenate([resampled(clip, frame_rate).positions.astype(np.float32) for clip in clips])


def lost_at(place: str, count: int) -> str:
    """Say that packets for a place reached no program."""
    keyed = ", or it lets in none without its keys (--keys DIR)" if "://" in place else ""
    return f"no program listens at {place}{keyed}: {count} packets were lost; start kinespace live first"


class OscFrameSender(osc.OscSender):
    """Sends frames as OSC datagrams."""

    def announce(self, announcement: Announcement) -> None:
        """Send `/motion/skeleton`."""
        self.send(osc.encode_announcement(announcement))

    def encode(self, frame: Frame) -> Any:  # noqa: ANN401 - each sender's own kind of packet, which `send` takes
        """Make a `/motion/frame`."""
        return osc.encode_frame(frame)


class ZmqFrameSender(zeromq.ZmqSender):
    """Publishes frames as ZeroMQ messages, the joint names with the first frame after each announcement."""

    _announced: Sequence[str] | None = None

    @cached_property
    def _numbers(self) -> defaultdict[str, "count[int]"]:
        """The numbers of each performer's further frames."""
        return defaultdict(count)

    def greet(self) -> None:
        """Send an empty message, to find out whether it arrives."""
        self.send([b"hello/", b""])

    def announce(self, announcement: Announcement) -> None:
        """Put the joint names into the next frame's header."""
        self._announced = announcement.joints

    def encode(self, frame: Frame) -> Any:  # noqa: ANN401 - as above
        """Make the message of a performer's next frame, with the joint names when they were just announced."""
        parts = zeromq.encode_frame(frame, next(self._numbers[frame.performer]), self._announced)
        self._announced = None
        return parts


FrameSender = OscFrameSender | ZmqFrameSender


class FrameStream:
    """Sends frames as they come, and before the first and every second the joints of their performer.

    Parameters
    ----------
    sender
        Where they go.
    joints
        Their joints.
    """

    def __init__(self, sender: FrameSender, joints: tuple[str, ...]) -> None:
        self.sender, self._joints = sender, joints
        self._announced: dict[str, float] = {}

    def send(self, frame: Frame) -> None:
        """Send a frame."""
        now = time.perf_counter()
        if now - self._announced.get(frame.performer, -math.inf) >= ANNOUNCE_EVERY:
            self._announced[frame.performer] = now
            self.sender.announce(Announcement(frame.performer, self._joints))
        self.sender.send(self.sender.encode(frame))


class Pace:
    """An absolute schedule: all times are measured from one start, so that delays never add up."""

    def __init__(self) -> None:
        self._start = time.perf_counter()

    def moment(self, due: float) -> float:
        """Give the `time.perf_counter` reading for some seconds after the start."""
        return self._start + due

    def put_off(self, due: float) -> float:
        """Shift the rest of the schedule so that a moment that is past is now; give the seconds."""
        late = max(time.perf_counter() - self.moment(due), 0.0)
        self._start += late
        return late

    def wait_for(self, due: float) -> None:
        """Sleep until some seconds after the start; return at once if that is past.

        Raises
        ------
        KeyboardInterrupt
            The program's end was asked for.
        """
        check_interrupted()
        while (remaining := self.moment(due) - time.perf_counter()) > 0:
            time.sleep(min(remaining, _MAX_SLEEP))
            check_interrupted()
