"""Positions of an LSL stream sent as frames to a port of this machine, as any sender would."""

import re
import threading
from collections.abc import Sequence
from contextlib import closing
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from kinespace.stream import Announcement, Frame
from kinespace.stream.outputs.lsl_sink import lsl
from kinespace.tools.feeding.feed import Cue, OscFrameSender

#: Seconds in which a stream must be found, and seconds of samples that wait while nobody takes them.
_FOUND_WITHIN, _KEPT = 5.0, 2
#: Seconds between two announcements of the joints, and between two looks for samples.
_ANNOUNCED_EVERY, _LOOK_EVERY = 1.0, 0.005
#: The axis at the end of a channel's label, as `head_x`, `head.X`, `head PositionX`.
_AXIS = re.compile(r"^(?P<joint>.+?)[ _.:/-]*(?:pos(?:ition)?[ _.-]*)?(?P<axis>[xyz])$", re.IGNORECASE)
#: A channel's type where the stream says it (MoBI's `PositionX`), and types that are no position.
_POSITION = re.compile(r"^position[ _]?(?P<axis>[xyz])$", re.IGNORECASE)
_OTHER = re.compile(r"orientation|quality", re.IGNORECASE)
#: Metres in a unit as streams name it.
_METRES = {"mm": 1e-3, "millimeters": 1e-3, "millimetres": 1e-3, "cm": 1e-2, "centimeters": 1e-2, "centimetres": 1e-2}


class Layout(NamedTuple):
    """The joints of a stream, the channels of each one's x, y and z, shape (joints, 3), and its unit in metres."""

    joints: tuple[str, ...]
    channels: NDArray[np.intp]
    metres: float

    @classmethod
    def of(cls, labels: Sequence[str], types: Sequence[str], units: Sequence[str]) -> "Layout":
        """Read the descriptions of a stream's channels, each empty where the stream says nothing.

        Raises
        ------
        ValueError
            No five joints have an x, a y and a z.
        """
        found: dict[str, dict[str, int]] = {}
        for channel, (label, kind) in enumerate(zip(labels, types, strict=True)):
            by_type, by_label = _POSITION.match(kind), _AXIS.match(label)
            if _OTHER.search(kind) or not (by_type or by_label):
                continue
            joint = by_label["joint"] if by_label else label
            axis = by_type["axis"] if by_type else by_label["axis"] if by_label else ""
            found.setdefault(joint, {}).setdefault(axis.lower(), channel)
        joints = {joint: [axes[axis] for axis in "xyz"] for joint, axes in found.items() if len(axes) == 3}
        if len(joints) < 5:
            some = ", ".join(labels[:4]) or "none"
            raise ValueError(f"--lsl-in: expected channels named like head_x, head_y, head_z, got {some}")
        unit = next((units[channel].lower() for axes in joints.values() for channel in axes), "")
        return cls(tuple(joints), np.array([*joints.values()], dtype=np.intp), _METRES.get(unit, 1.0))


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
        self._lsl = lsl()
        streams = self._lsl.resolve_byprop("name", name, timeout=_FOUND_WITHIN)
        if not streams:
            others = sorted({each.name() for each in self._lsl.resolve_streams(0.5)})
            raise OSError(f"--lsl-in: no stream {name!r} on the network; there are: {', '.join(others) or 'none'}")
        clocks = self._lsl.proc_clocksync | self._lsl.proc_monotonize
        self._inlet = self._lsl.StreamInlet(streams[0], max_buflen=_KEPT, processing_flags=clocks)
        info = self._inlet.info(timeout=_FOUND_WITHIN)
        described = (info.get_channel_labels(), info.get_channel_types(), info.get_channel_units())
        blank = [""] * info.channel_count()
        self.layout = Layout.of(*([text or "" for text in each] if each else blank for each in described))
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
        announced, count = -np.inf, 0
        with closing(self._sender) as sender:
            while not self._ended.wait(_LOOK_EVERY):
                samples, stamps = self._inlet.pull_chunk()
                if stamps and (now := self._lsl.local_clock()) - announced >= _ANNOUNCED_EVERY:
                    sender.announce(Announcement(self._name, self.layout.joints))
                    announced = now
                for sample, stamp in zip(samples, stamps, strict=True):
                    sender.send(sender.encode(Cue(stamp, self._frame(sample, stamp), count)))
                    count += 1

    def _frame(self, sample: Any, stamp: float) -> Frame:  # noqa: ANN401 - a list or an array of pylsl's
        numbers = np.asarray(sample, dtype=np.float32)
        return Frame(self._name, stamp, numbers[self.layout.channels] * np.float32(self.layout.metres))
