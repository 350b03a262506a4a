"""A feed that is sent, the answers that come meanwhile, and the report on both."""

import time
from collections import Counter
from collections.abc import Iterable, Sequence

from kinespace.stream import Announcement, osc
from kinespace.tools.cli.console import console, note, print_json, say, table_of
from kinespace.tools.feeding.feed import ANNOUNCE_EVERY, Cue, FrameSender, Pace, lost_at
from kinespace.tools.feeding.service import Listener, Received, answer_in, classes_in

#: Seconds without an answer after which no more are expected.
_LINGER = 0.3
#: Seconds to wait after the last frame, at most.
_MAX_LINGER = 3.0
#: Frames after which it is said that nobody listens.
_SOON = 30
#: Seconds for which a feed may stand still without a note.
_NOTICED = 0.05


class Exchange:
    """One feed with its answers."""

    def __init__(self, sender: FrameSender, listener: Listener | None, announcement: Announcement, place: str) -> None:
        self._sender, self._place = sender, place
        self._listener = listener
        self._announcement = announcement
        # OSC answers name the performer in their address, which cannot hold every character.
        self._names = {announcement.performer, osc.address_part(announcement.performer)}
        #: The answers while each class was performed, and those of them that were right; none has a class at moments
        #: without a label.
        self._answers, self._right = Counter[str](), Counter[str]()
        self._sent = self._received = 0
        self._stood_still = 0.0
        self._performed = ""
        #: The recogniser's classes, once it has listed them.
        self._classes: list[str] = []

    def play(self, cues: Iterable[Cue]) -> None:
        """Send every frame when it is due, the skeleton before the first and every second.

        Each recording is read in the pause before it. When that takes longer the feed stands still, and then goes on
        at its own pace: frames sent all at once to catch up would be no feed.
        """
        pace, next_announcement, recording = Pace(), 0.0, 0
        for cue in cues:
            if cue.recording != recording:
                recording = cue.recording
                self._stood_still += pace.put_off(cue.due)
            if cue.due >= next_announcement:
                self._sender.announce(self._announcement)
                next_announcement = cue.due + ANNOUNCE_EVERY
            packet = self._sender.encode(cue)
            if self._listener:
                self._take_in(self._listener.listen_until(pace.moment(cue.due)))
            else:
                pace.wait_for(cue.due)
            self._sender.send(packet)
            self._sent += 1
            if self._sent == _SOON and self.reached_nobody:
                note(f"no program listens at {self._place} so far; start kinespace live there")
            self._performed = cue.class_name
        end = time.perf_counter() + _MAX_LINGER
        while self._listener and time.perf_counter() < end:
            if not self._take_in(self._listener.listen_until(time.perf_counter() + _LINGER)):
                break

    def _take_in(self, received: Sequence[Received]) -> bool:
        """Count the answers that came; say whether one about our performer was among them."""
        self._received += len(received)
        before = self._answers.total()
        for each in received:
            self._classes = classes_in(each.packet) or self._classes
            answer = answer_in(each.packet)
            if answer and answer.performer in self._names:
                self._answers[self._performed] += 1
                self._right[self._performed] += self._performed == answer.label
        return self._answers.total() > before

    @property
    def answered(self) -> bool:
        """Whether any answer came."""
        return bool(self._answers)

    @property
    def reached_nobody(self) -> bool:
        """Whether it is known that no frame reached a program."""
        return bool(self._sent) and self._sender.unheard >= self._sent

    def _lacking(self) -> list[str]:
        """List the classes performed that the library lacks; none before the recogniser has listed its own."""
        return sorted({*self._answers} - {"", *self._classes}) if self._classes else []

    def _silence(self) -> str:
        """Say that no answer came, and list checks."""
        if self._received:
            other = f"{self._received} other packets: do frames reach the recogniser, and can it use their joints?"
            return f"no answers about {self._announcement.performer!r} came, but {other}"
        if self.reached_nobody:
            return "no answers came"
        return "no answers came: is a recogniser running, and does it send its answers here?"

    def report(self, *, as_json: bool) -> None:
        """Print the counts and, when listening, the share of right answers."""
        by_class = {name: count for name, count in sorted(self._answers.items()) if name}
        every, unlabelled, right = sum(by_class.values()), self._answers[""], self._right.total()
        if as_json:
            figures = {
                "sent": self._sent,
                "failed": self._sender.failed,
                "unheard": self._sender.unheard,
                "answers": every,
                "unlabelled": unlabelled,
                "lacking": self._lacking(),
                "right": round(right / every, 4) if every else None,
            }
            print_json(figures)
            return
        console.print(f"{self._sent} frames sent, {self._sender.failed} refused by the system")
        if self._stood_still > _NOTICED:
            console.print(f"the feed stood still for {self._stood_still:.1f} s: a recording took longer to be read")
        if self._sender.unheard:
            say(lost_at(self._place, self._sender.unheard))
        if self._listener and not self._answers:
            say(self._silence())
        elif self._listener:
            rows = [(name, f"{count}", f"{self._right[name] / count:.0%}") for name, count in by_class.items()]
            rows.append(("all", f"{every}", f"{right / every:.0%}" if every else ""))
            rows += [("unlabelled", f"{unlabelled}", "")] if unlabelled else []
            title = "Answers while each class was performed"
            console.print(table_of(title, ("performed", "answers", "right"), rows))
            if lacking := self._lacking():
                share = sum(by_class[name] for name in lacking) / every
                say(f"the library lacks {', '.join(lacking)}: {share:.0%} of the labelled time, and no answer is right")
