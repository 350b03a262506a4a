"""Frames made of joints: joints that belong together make a frame, absent ones are held. No socket, no clock.

A frame may come as one message, one bundle, several bundles or loose messages, with or without a mark at its end. It is
closed by an end message, by the end of a bundle, by a joint that comes again, by being complete, or by time; the preset
says which of these apply. An end message inside a bundle counts at the bundle's end, because some senders put it before
the last joints.

A receiver that starts in the middle of a frame would mix two frames for ever if it only looked at joints: the last
joints of one frame and the first of the next are a complete set. But the joints of one frame come in a burst. So the
timeout is half of the time between two frames, if that is less than the preset's, and the silence between two bursts
shows where a frame begins.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from kinespace.library.signature.landmark_body import body_of
from kinespace.stream.feeds.kinematics import Vector, world_positions
from kinespace.stream.feeds.message_reader import Content, Mapper, MessageError, Sighting
from kinespace.stream.feeds.preset import Closing, Means, Preset
from kinespace.stream.frame import Announcement, Frame
from kinespace.stream.osc.packet import Message
from kinespace.stream.status import InputCounts

#: Performers of one feed at once, at most.
MAX_PERFORMERS = 64
#: Seconds of silence after which a performer is forgotten, and after which a bone that came before counts as one that
#: this sender no longer sends.
FORGET_AFTER = 5.0
#: A sender's time this far behind, seconds, means a clock that began again, not a late joint.
_NEW_CLOCK = 1.0
#: When a frame has less than this share of the joints that came lately, a joint that comes again is late, not the next
#: frame's.
_STRAGGLERS = 0.5
#: Silence that separates two frames, relative to the time between them.
_PAUSE = 0.5
#: How much each joint that comes again counts in the time between two frames.
_NEWER = 0.05
#: Seconds: a longer interval is an absence and does not count for the frame rate.
_MAX_INTERVAL = 0.2
#: Share of the joints that may be absent for long: their positions are NaN, and the frame is given out all the same.
_LOST = 0.2
#: Names of a performer's joints by which a convention is found, at most: no body has so many.
_MAX_NAMES = 128
_NOWHERE = (math.nan, math.nan, math.nan)


@dataclass(slots=True)
class AssemblerCounts(InputCounts):
    """Counts of messages and joints, by their fate.

    A message is malformed if it has an address of the preset but other arguments. It is foreign if the preset knows
    neither it nor a joint in it.
    """

    #: Messages that were read.
    understood: int = 0
    #: Frames given out.
    frames: int = 0
    #: Frames refused because a joint is impossibly far; they count as incomplete, too.
    absurd: int = 0
    #: Joints that came after their frame was closed.
    late: int = 0
    #: Joints taken over from an earlier frame, because they were absent.
    held: int = 0
    #: Joints that the sender does not see, or is not sure of, as it says itself.
    unsure: int = 0
    #: Frames of performers for whom there was no room.
    no_room: int = 0
    #: Frames by the reason why they were closed.
    closed_by: Counter[str] = field(default_factory=Counter)
    #: Joints that were absent for too long, or never came, with the number of their frames.
    absent: Counter[str] = field(default_factory=Counter)


class _Packet(NamedTuple):
    """When a packet came, the number of its sender, and whether it is a bundle."""

    arrival: float
    sender: int
    is_bundle: bool


@dataclass(slots=True)
class _OpenFrame:
    """One performer's open frame; the performer's name as frames have it."""

    name: str
    sender: int
    last_message: float
    open: dict[str, Sighting] = field(default_factory=dict)
    opened: float = 0.0
    #: The sender's time of the open frame.
    time: float | None = None
    #: The sender's time of the last frame given out.
    closed_time: float | None = None
    #: Where each joint was last seen, and when.
    seen: dict[str, tuple[Sighting, float]] = field(default_factory=dict)
    #: Seconds from one frame to the next, measured by joints that come again.
    interval: float = 0.0
    #: How far the sender's clock was ahead of ours at that frame.
    ahead: float | None = None
    #: Whether an end message came in a bundle that is not over.
    ending: bool = False
    #: The joints of its frames, in their order, as they were announced; none before.
    announced: tuple[str, ...] = ()


class FrameAssembler:
    """Makes frames of a feed's messages.

    Parameters
    ----------
    preset
        The meaning of the messages, and when a frame is complete.
    """

    def __init__(self, preset: Preset) -> None:
        self.preset = preset
        self.counts = AssemblerCounts()
        #: The reason why the last malformed message is malformed.
        self.why_malformed = ""
        self.mapper = Mapper(preset)
        self._bodies: dict[str, _OpenFrame] = {}
        self._out: list[Frame | Announcement] = []
        #: The last time that each sender sent for all its performers.
        self._sender_times: dict[int, float] = {}
        #: The sender's names of the joints of its frames, with the library's.
        self._needed: Mapping[str, str] = {name: target for name, target in preset.joint_map.items() if target}
        rules = [rule for rule in preset.messages if rule.means in (Means.JOINT, Means.FRAME)]
        self._says_who = any("performer" in rule.arguments or "{performer}" in rule.address for rule in rules)
        self._targets = preset.sent
        #: The joints that a performer's sender sends are nearly always the same.
        self._named = lru_cache(MAX_PERFORMERS)(self._known)
        self._axes = np.array([axis for axis, _ in preset.axes])
        self._metres = np.array([sign for _, sign in preset.axes]) * np.array(preset.metres)[self._axes]

    @property
    def never_seen(self) -> set[str]:
        """The joints, by the library's names, that were absent from every frame."""
        closed = self.counts.closed_by.total()
        return {joint for joint, frames in self.counts.absent.items() if frames == closed}

    def push(
        self, messages: Sequence[Message], arrival: float, *, bundle: bool = False, sender: int = 1
    ) -> list[Frame | Announcement]:
        """Take in the messages of one packet.

        Parameters
        ----------
        messages
            In the order of the packet.
        arrival
            Seconds on our clock.
        bundle
            Whether the packet was a bundle.
        sender
            The number of the sender; the performers of all senders but the first get it added to their names.

        Returns
        -------
        Frames that were completed, each performer's joints announced before the performer's first frame.
        """
        packet = _Packet(arrival, sender, bundle)
        given = self.expire(arrival)
        for message in messages:
            try:
                reading = self.mapper.read(message)
            except MessageError as error:
                self.counts.malformed += 1
                self.why_malformed = str(error)
                continue
            if reading is None or reading.means is Means.NOTHING:
                self.counts.foreign += 1
                continue
            is_foreign = reading.means in (Means.JOINT, Means.FRAME) and reading.present and not reading.sightings
            self.counts.foreign += is_foreign
            self.counts.understood += not is_foreign
            if reading.means not in (Means.NAME, Means.ORDER):
                self._take(reading, packet)
        if bundle:
            for body in self._bodies.values():
                if body.last_message == arrival:
                    self._end_bundle(body)
        given += self._out
        self._out = []
        return given

    def expire(self, now: float) -> list[Frame | Announcement]:
        """Close frames that wait for too long, and forget silent performers; give what was completed until now."""
        for body in list(self._bodies.values()):
            silent = now - body.last_message
            timeout = min(self.preset.closings.timeout, _PAUSE * body.interval)
            if body.open and Closing.TIMEOUT in self.preset.closings.by and silent > timeout:
                self._close(body, Closing.TIMEOUT)
            if silent > FORGET_AFTER:
                del self._bodies[body.name]
        given, self._out = self._out, []
        return given

    def _take(self, reading: Content, packet: _Packet) -> None:
        """Take in one message."""
        if reading.performer is None and reading.means in (Means.TIME, Means.BEGIN) and reading.time is not None:
            self._sender_times[packet.sender] = reading.time
        for name in self._names(reading, packet.sender):
            body = self._bodies.get(name) or self._new_body(name, reading, packet)
            if body is not None:
                body.last_message = packet.arrival
                self._take_for(body, reading, packet)

    def _take_for(self, body: _OpenFrame, reading: Content, packet: _Packet) -> None:
        if not reading.present:
            if body.open:
                self._close(body, Closing.END)
            body.seen.clear()
        elif reading.means in (Means.BEGIN, Means.END):
            body.ending |= packet.is_bundle and reading.means is Means.END
            if body.open and not body.ending:
                self._close(body, Closing.END)
            body.time = reading.time if reading.time is not None else body.time
        elif reading.means is Means.TIME:
            body.time = reading.time
        else:
            is_whole = reading.means is Means.FRAME
            if is_whole and body.open:
                self._close(body, Closing.REPEAT)
            self._add(body, reading, packet.arrival)
            if is_whole and body.open:
                self._close(body, Closing.COMPLETE)

    def _names(self, reading: Content, sender: int) -> Sequence[str]:
        """Give the performers that a message is about: all of its sender's if it names none and is no joint."""
        suffix = "" if sender == 1 else f"-{sender}"
        if reading.performer is not None:
            return (reading.performer + suffix,)
        if reading.means in (Means.JOINT, Means.FRAME) or not self._says_who:
            return (self.preset.performer + suffix,)
        return [name for name, body in self._bodies.items() if body.sender == sender]

    def _new_body(self, name: str, reading: Content, packet: _Packet) -> _OpenFrame | None:
        """Begin a performer, if the message has joints and there is room."""
        is_empty = reading.means in (Means.JOINT, Means.FRAME) and not any(each.position for each in reading.sightings)
        if is_empty or reading.means in (Means.BEGIN, Means.END) or not reading.present:
            return None
        if len(self._bodies) >= MAX_PERFORMERS:
            self.counts.no_room += 1
            return None
        last = self._sender_times.get(packet.sender)
        self._bodies[name] = _OpenFrame(name, packet.sender, packet.arrival, time=last, interval=1 / self.preset.rate)
        return self._bodies[name]

    def _add(self, body: _OpenFrame, reading: Content, arrival: float) -> None:
        """Take in a joint, or several that came together."""
        if reading.time is not None and not self._in_time(body, reading.time):
            self.counts.late += len(reading.sightings)
            return
        for sighting in reading.sightings:
            if sighting.position is None:
                self.counts.unsure += 1
                continue
            # The next frame's first joint, or a late one.
            if sighting.joint in body.open and self._is_straggler(body):
                self.counts.late += 1
            elif sighting.joint in body.open and Closing.REPEAT in self.preset.closings.by:
                self._close(body, Closing.REPEAT)
            if not body.open:
                body.opened = arrival
            body.time = body.time if reading.time is None else reading.time
            if sighting.joint in body.seen:
                since = arrival - body.seen[sighting.joint][1]
                body.interval += _NEWER * (min(since, _MAX_INTERVAL) - body.interval)
            body.open[sighting.joint] = sighting
            body.seen[sighting.joint] = (sighting, arrival)
        # The count is quick, and excludes all but the last joints.
        all_here = len(body.open) >= len(self._targets) and self._has_all(body.open)
        if all_here and Closing.COMPLETE in self.preset.closings.by:
            self._close(body, Closing.COMPLETE)

    def _in_time(self, body: _OpenFrame, time: float) -> bool:
        """Let a joint of another time begin another frame; False for a joint that is too late for its own frame."""
        reference = body.time if body.open else body.closed_time
        if reference is None or (body.open and time == reference):
            return True
        if reference - _NEW_CLOCK < time <= reference:
            return False
        if body.open:
            self._close(body, Closing.REPEAT)
        return True

    def _is_straggler(self, body: _OpenFrame) -> bool:
        """Tell a late joint of the last frame from the first of the next, by how few joints the open frame has."""
        return len(body.open) < _STRAGGLERS * self._coming(body)

    def _coming(self, body: _OpenFrame) -> int:
        """Count the joints that came lately: a frame that has them all is complete."""
        earliest = body.opened - self.preset.closings.hold
        return sum(moment >= earliest for _, moment in body.seen.values())

    def _has_all(self, joints: Iterable[str]) -> bool:
        return {self._needed.get(joint) for joint in joints}.issuperset(self._targets)

    def _end_bundle(self, body: _OpenFrame) -> None:
        ended, body.ending = body.ending, False
        if body.open and ended:
            self._close(body, Closing.END)
        # With every joint that came lately, and not until all joints have come once.
        elif (
            body.open
            and Closing.BUNDLE in self.preset.closings.by
            and len(body.open) >= self._coming(body)
            and (self.preset.bones or self.preset.closings.some or self._has_all(body.seen))
        ):
            self._close(body, Closing.BUNDLE)

    def _close(self, body: _OpenFrame, by: Closing) -> None:
        """Give out the open frame, or refuse it; in either case the next frame begins."""
        moment = self._moment(body)
        scraps = by is not Closing.COMPLETE and self._is_straggler(body)
        opened, body.open = body.open, {}
        body.closed_time, body.time = body.time, None
        if scraps:
            self.counts.late += len(opened)
            return
        self.counts.closed_by[str(by)] += 1
        joints, targets, named = self._needed, self._targets, self.preset.joints
        if self.preset.closings.some:
            # The joints that came in the last seconds.
            came = [name for name, (_, at) in body.seen.items() if body.opened - at <= FORGET_AFTER]
            joints = self._named(tuple(came[:_MAX_NAMES]))
            targets = named = tuple(dict.fromkeys(joints.values()))
        places = self._placed_bones(body, opened) if self.preset.bones else self._placed(body, opened, joints)
        if not places:
            self.counts.incomplete += 1
            return
        # A number that overflows is impossibly far, and is refused as such.
        with np.errstate(over="ignore", invalid="ignore"):
            positions = np.array([places[target] for target in targets])[:, self._axes] * self._metres
        if self.preset.guessed:
            positions = body_of(self._targets, positions)
        try:
            frame = Frame(body.name, moment, positions)
        except ValueError:
            self.counts.absurd += 1
            self.counts.incomplete += 1
            return
        self.counts.frames += 1
        if body.announced != named:
            body.announced = named
            self._out.append(Announcement(body.name, named))
        self._out.append(frame)

    def _moment(self, body: _OpenFrame) -> float:
        """Give a frame's time; a frame without a time is as far from its arrival as the frame before."""
        if self.preset.clock == "arrival":
            return body.opened
        if body.time is not None:
            body.ahead = body.time - body.opened
        return body.opened + (body.ahead or 0.0)

    def _known(self, came: Sequence[str]) -> Mapping[str, str]:
        """Give the joints that the library has, with its names."""
        return {name: target for name, target in self.preset.named(came).items() if target}

    def _placed(
        self, body: _OpenFrame, opened: Mapping[str, Sighting], joints: Mapping[str, str]
    ) -> dict[str, Vector] | None:
        """Find each joint in the frame or, held, in an earlier one; None when too many are absent for too long."""
        places: dict[str, Vector] = {}
        absent = dict[str, None]()
        for name, target in joints.items():
            if target in places and name not in opened:
                continue
            sighting = opened.get(name) or self._held(body, name, self.preset.closings.hold)
            if sighting is None or sighting.position is None:
                absent[target] = None
            else:
                places[target] = sighting.position
        wanted = len({*joints.values()})
        return self._done_without([target for target in absent if target not in places], places, wanted)

    def _placed_bones(self, body: _OpenFrame, opened: Mapping[str, Sighting]) -> dict[str, Vector] | None:
        """Place bones in the world; bones that the sender never sends stay at rest.

        A bone that is absent for too long is lost, and so are the bones below it, because its rotation is not known.
        """
        poses, lost = {}, set[str]()
        for name, bone in self.preset.bones.items():
            sighting = opened.get(name) or self._held(body, name, self.preset.closings.hold)
            if sighting is not None:
                poses[name] = (sighting.position, sighting.rotation)
            if bone.parent in lost or (sighting is None and self._held(body, name, FORGET_AFTER) is not None):
                lost.add(name)
        world = world_positions(self.preset.bones, poses)
        places = {target: world[name] for name, target in self._needed.items()}
        absent = [target for name, target in self._needed.items() if name in lost]
        return self._done_without(absent, places, len(self._targets))

    def _done_without(self, lacking: Sequence[str], places: dict[str, Vector], joints: int) -> dict[str, Vector] | None:
        """Give positions with NaN for missing joints; None when too many are missing for a frame."""
        self.counts.absent.update(lacking)
        if len(lacking) > _LOST * joints:
            return None
        return places | dict.fromkeys(lacking, _NOWHERE)

    def _held(self, body: _OpenFrame, joint: str, longest: float) -> Sighting | None:
        sighting, moment = body.seen.get(joint, (None, -math.inf))
        if sighting is None or body.opened - moment > longest:
            return None
        if longest == self.preset.closings.hold:
            self.counts.held += 1
        return sighting
