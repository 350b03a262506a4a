"""A worker: frames in, recognitions out, for the performers that it is sent. No socket, clock, thread or process.

With a performer whom it takes over, a worker gets the frames of the last seconds. The recogniser sees them first, so
that its windows and averages equal the former worker's. Then the worker answers the frames that nobody has answered.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kinespace.stream.frame import NewSender
from kinespace.stream.recognizer.recognizer import RecognizerCounts
from kinespace.stream.workers.wire import Answered, Report

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinespace.stream.recognizer import Performers
    from kinespace.stream.workers.wire import SentFrame

#: Seconds of frames with which the recogniser of a performer who is taken over compares windows before it answers: the
#: windows before are shorter than the former worker's, and would only mislead its averages.
_COMPARED = 1.0


class Worker:
    """Recognises the performers that it is sent.

    Parameters
    ----------
    performers
        The recognisers.
    """

    def __init__(self, performers: Performers) -> None:
        self.performers = performers
        #: Performers whose frames are not answered yet.
        self._warming: set[str] = set()
        #: Performers whose next answer must say which joints carry it.
        self._asked: set[str] = set()
        #: Counts of the frames of warming up, which the former worker has counted, too.
        self._warmed = RecognizerCounts()

    def push(self, frames: Sequence[SentFrame], now: float) -> list[Answered]:
        """Take in frames in their order; give the answers to them. FormatError for an impossible frame."""
        answers = []
        for sent in frames:
            name, frame = sent.performer, sent.frame()
            if sent.begins or sent.go_on or sent.joints:
                self._prepare(sent, now)
            if sent.asks:
                self._asked.add(name)
            recognition = self.performers.push(frame, now)
            if name in self._warming:
                self._warmed.frames += 1
                self._warmed.hops += recognition is not None
            elif recognition:
                carried = None
                if name in self._asked:
                    self._asked.discard(name)
                    carried = self.performers.carried(name)
                recognizer = self.performers.recognizer_of(name)
                long_ago = recognizer.long_ago if recognizer else None
                answers.append(Answered(sent.seq, sent.at, recognition, long_ago, carried))
        return answers

    def _prepare(self, sent: SentFrame, now: float) -> None:
        """Begin with a frame's performer, take in the joints' names, or answer from now on."""
        name, performers = sent.performer, self.performers
        if sent.begins:
            performers.push_all([NewSender(name)], now)
            self._warming.discard(name)
        if announced := sent.announcement():
            performers.announce(announced, now)
        recognizer = performers.recognizer_of(name, now) if sent.take_over or sent.go_on else None
        if past := sent.take_over:
            self._warming.add(name)
            if recognizer and past.time is not None:
                recognizer.only_follow(past.time - _COMPARED)
            if recognizer and past.long_ago:
                recognizer.go_on(past.long_ago.of_the_body)
        if past := sent.go_on:
            self._warming.discard(name)
            if recognizer and past.time is not None:
                recognizer.keep_time_with(past.time)
            if recognizer and past.long_ago:
                recognizer.go_on(past.long_ago)

    def report(self, now: float, *, dropped: int = 0, leaves: bool = False) -> Report:
        """Forget silent performers, and give the counters."""
        performers = self.performers
        performers.drop_silent(now)
        self._warming.difference_update(performers.take_gone())
        counts = performers.counts
        counts.recognizers.add(self._warmed, -1)
        return Report(counts, performers.refused, performers.doubted, performers.compared, dropped, leaves)
