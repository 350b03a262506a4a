"""Positions of an LSL stream sent as frames to a port of this machine, as any sender would."""

import re
import threading
from collections.abc import Sequence
from contextlib import closing
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.recordings.formats.measures import metres_of
from kinespace.library.recordings.formats.table_header import header_of
from kinespace.stream import Frame
from kinespace.stream.outputs.lsl_sink import lsl
from kinespace.tools.feeding.feed import FrameStream, OscFrameSender

#: Seconds in which a stream must be found, and seconds of samples that wait while nobody takes them.
_FOUND_WITHIN, _KEPT = 5.0, 2
#: Seconds between two looks for samples.
_LOOK_EVERY = 0.005
#: A channel's type where the stream says it (MoBI's `PositionX`), and types that are no position.
_POSITION = re.compile(r"position[ _]?[xyz]", re.IGNORECASE)
_OTHER = re.compile(r"orientation|quality", re.IGNORECASE)


def _column(label: str, kind: str) -> str:
    """Name a channel as a table names its columns; empty for one that is no position."""
    if _OTHER.search(kind):
        return ""
    return f"{label} {kind[-1]}" if _POSITION.fullmatch(kind) else label


class StreamJoints(NamedTuple):
    """The joints of a stream, the channels of each one's x, y and z, shape (joints, 3), and its unit in metres."""

    joints: tuple[str, ...]
    channels: NDArray[np.intp]
    metres: float

    @classmethod
    def of(cls, labels: Sequence[str], types: Sequence[str], units: Sequence[str]) -> "StreamJoints":
        """Read the descriptions of a stream's channels as a table's columns, each empty where the stream says nothing.

        Raises
        ------
        ValueError
            No five joints have an x, a y and a z.
        """
        header = header_of([[*map(_column, labels, types)]])
        if header is None or len(header.joints) < MIN_JOINTS:
            some = ", ".join(labels[:4]) or "none"
            raise ValueError(f"--lsl-in: expected channels named like head_x, head_y, head_z, got {some}")
        channels = np.array([*header.joints.values()], dtype=np.intp)
        return cls(tuple(header.joints), channels, metres_of(units[channels[0, 0]]) or 1.0)


class LslFeed:
    """Takes samples in a thread; a context manager that ends it.

    Parameters
    ----------
    name
        The stream's name, which is the performer's too.
    host, port
        Where OSC frames come in.

    Raises
    ------
    ImportError
        pylsl is not there.
    OSError
        No stream of this name is found within five seconds.
    ValueError
        Its channels are no positions.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        found = lsl()
        streams = found.resolve_byprop("name", name, timeout=_FOUND_WITHIN)
        if not streams:
            others = sorted({each.name() for each in found.resolve_streams(1.5)})
            raise OSError(f"--lsl-in: no stream {name!r} on the network; there are: {', '.join(others) or 'none'}")
        clocks = found.proc_clocksync | found.proc_monotonize
        self._inlet = found.StreamInlet(streams[0], max_buflen=_KEPT, processing_flags=clocks)
        info = self._inlet.info(timeout=_FOUND_WITHIN)
        described = (info.get_channel_labels(), info.get_channel_types(), info.get_channel_units())
        blank = [""] * info.channel_count()
        self.layout = StreamJoints.of(*([text or "" for text in each] if each else blank for each in described))
        self._name, self._sender = name, OscFrameSender(host, port)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="kinespace LSL", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._inlet.close_stream()

    def _run(self) -> None:
        with closing(self._sender) as sender:
            stream = FrameStream(sender, self.layout.joints)
            while not self._ended.wait(_LOOK_EVERY):
                for sample, stamp in zip(*self._inlet.pull_chunk(), strict=True):
                    numbers = np.asarray(sample, dtype=np.float32)[self.layout.channels]
                    stream.send(Frame(self._name, stamp, numbers * np.float32(self.layout.metres)))
