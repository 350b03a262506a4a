"""A running recogniser as the user sees it: a table, or a line per change; a summary at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from kinespace.stream.outputs.sink import Sink
from kinespace.stream.recognition import EventKind, Outcome
from kinespace.stream.teaching.wire import as_line
from kinespace.tools.terminal.console import console, printable
from kinespace.tools.terminal.tables import narrow_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.status import Status
    from kinespace.stream.teaching.notices import Notice

#: Characters of a full score bar, and of a terminal wide enough to have one.
_BAR = 20
_WIDE = 110
#: Characters between two columns.
_BETWEEN = 2
#: Notices of teaching that are shown.
_NOTICES = 3


def score_shown(score: float, width: int) -> Text:
    """Show a score from 0 to 1, with a bar before it on a terminal of enough characters."""
    number = Text(f"{score:.3f}")
    if width < _WIDE:
        return number
    filled = round(min(max(score, 0.0), 1.0) * _BAR)
    return Text("█" * filled, style="green") + Text("░" * (_BAR - filled) + " ", style="dim") + number


class PlainLines(Sink):
    """A sink that prints a line whenever a performer's label changes."""

    def __init__(self) -> None:
        self._labels: dict[str, str] = {}
        self._refused: dict[str, str] = {}
        self._notes: set[str] = set()
        self._doubted: dict[str, str] = {}
        self._compared: dict[str, str] = {}

    def publish(self, recognition: Recognition) -> None:
        """Print the recognition if it says something new."""
        if self._labels.get(recognition.performer) != recognition.label:
            self._labels[recognition.performer] = recognition.label
            console.print(
                f"{recognition.time:10.3f} s  {printable(recognition.performer)}  {recognition.label}  "
                f"score {recognition.score:.3f}  margin {recognition.margin:.3f}",
                soft_wrap=True,
            )

    def publish_event(self, event: Event) -> None:
        """Print the event."""
        console.print(
            f"{event.time:10.3f} s  {printable(event.performer)}  {event.kind}: {event.label}", soft_wrap=True
        )

    def publish_status(self, status: Status) -> None:
        """Forget performers that have left, so that their return is printed again."""
        self._labels = {name: label for name, label in self._labels.items() if name in status.performers}
        for name, why in status.refused.items():
            if self._refused.get(name) != why:
                console.print(refused_frames(name, why), soft_wrap=True)
        for name, what in status.doubted.items():
            if self._doubted.get(name) != what:
                console.print(doubted_joints(name, what), soft_wrap=True)
        self._doubted = status.doubted
        for name, what in status.compared.items():
            if self._compared.get(name) != what:
                console.print(compared_joints(name, what), soft_wrap=True)
        self._refused, self._compared = status.refused, status.compared
        for note in status.notes:
            # A sender may find a new mistake each second: one line of each kind is enough while it runs.
            kind = note.partition(":")[0]
            if kind not in self._notes:
                self._notes.add(kind)
                console.print(printable(note), soft_wrap=True)

    def publish_notice(self, notice: Notice) -> None:
        """Print it."""
        if line := as_line(notice):
            console.print(printable(line), soft_wrap=True, markup=False)


class LiveTable(Sink):
    """A sink that remembers what to draw: the last recognition of each performer, the last status."""

    def __init__(self, classes: Sequence[str]) -> None:
        self._classes = classes
        self._latest: dict[str, Recognition] = {}
        self._going_on: dict[str, str] = {}
        self._status: Status | None = None
        #: What is said below the table while somebody may be taught.
        self.hint = ""
        self._taught: list[str] = []

    def publish_notice(self, notice: Notice) -> None:
        """Remember the last ones."""
        if line := as_line(notice):
            self._taught = [*self._taught, printable(line)][-_NOTICES:]

    def publish(self, recognition: Recognition) -> None:
        """Remember the recognition."""
        self._latest[recognition.performer] = recognition

    def publish_event(self, event: Event) -> None:
        """Remember the motion that is going on."""
        self._going_on[event.performer] = event.label if event.kind is EventKind.START else ""

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Remember the classes."""
        self._classes = classes

    def publish_status(self, status: Status) -> None:
        """Remember the status, and forget performers that have left."""
        self._status = status
        self._latest = {name: last for name, last in self._latest.items() if name in status.performers}
        self._going_on = {name: label for name, label in self._going_on.items() if name in status.performers}

    def drawn(self) -> Table:
        """Draw the table as it is now; from any thread."""
        table = narrow_table("kinespace live", self._caption())
        latest, rates = dict(self._latest), self._status.performers if self._status else {}
        performers = [printable(name) for name in latest]
        figures = self._figures_beside(performers)
        for heading in ("performer", "doing", "this moment"):
            table.add_column(heading, overflow="fold")
        for heading in figures:
            table.add_column(heading, justify="left" if heading == "score" else "right", no_wrap=True)
        for shown, (name, last) in zip(performers, latest.items(), strict=True):
            cells = {
                "score": score_shown(last.score, console.width),
                "margin": Text(f"{last.margin:.3f}"),
                "frames/s": Text(f"{rates[name]:.0f}" if name in rates else ""),
            }
            doing = Text(self._going_on.get(name, ""), style="bold")
            label = Text(last.label, style="" if last.outcome is Outcome.NAMED else "dim")
            table.add_row(shown, doing, label, *(cells[heading] for heading in figures))
        if not self._latest:
            table.add_row("", Text("waiting for frames ...", style="dim"))
        return table

    def _figures_beside(self, performers: Sequence[str]) -> list[str]:
        """Choose the figures for which there is room when the names of performers and classes are not broken."""
        names = max(map(len, ("performer", *performers))) + 2 * max(map(len, ("this moment", *self._classes)))
        room = console.width - names - 3 * _BETWEEN
        figures = []
        for heading, width in {"score": len(score_shown(1.0, console.width)), "margin": 6, "frames/s": 8}.items():
            room -= width + _BETWEEN
            figures += [heading] if room >= 0 else []
        return figures

    def _caption(self) -> str:
        status = self._status
        if status is None:
            return f"{len(self._classes)} classes"
        told = "".join(f"\n{compared_joints(name, what)}" for name, what in status.compared.items())
        told += "".join(f"\n{refused_frames(name, why)}" for name, why in status.refused.items())
        told += "".join(f"\n{doubted_joints(name, what)}" for name, what in status.doubted.items())
        told += "".join(f"\n{printable(note)}" for note in status.notes)
        told += "".join(f"\n{line}" for line in (*self._taught, *([self.hint] if self.hint else ())))
        return f"{len(self._classes)} classes · {counts(status)}{told}"


def doubted_joints(performer: str, what: str) -> str:
    """Say which of a performer's joints cannot be believed."""
    return f"performer {printable(performer)}: {what}"


def compared_joints(performer: str, what: str) -> str:
    """Say by which joints a performer is compared."""
    return f"performer {printable(performer)}: {what}"


def refused_frames(performer: str, why: str) -> str:
    """Say why a performer's frames are refused, and what can be done about it."""
    return (
        f"performer {printable(performer)}: frames refused: {why}. Let the sender send them, or say them with --joints"
    )


def counts(status: Status) -> str:
    """Say in one line what came in and what was lost."""
    inputs, outcomes = status.inputs, status.outcomes
    recognizers = outcomes.recognizers
    return (
        f"received {inputs.received}, malformed {inputs.malformed}, foreign {inputs.foreign}, "
        f"overrun {inputs.overrun}, missing {inputs.missing}, out of order {recognizers.out_of_order}, "
        f"other joints {outcomes.other_joints}, no room {outcomes.no_room}"
        f"{f', from other senders {status.admission.other_sender}' if status.admission.other_sender else ''}"
        f"{f', not let in {status.admission.not_allowed}' if status.admission.not_allowed else ''}"
        f"{f', odd times {status.admission.odd_times}' if status.admission.odd_times else ''}"
        f"{f', incomplete {inputs.incomplete}' if inputs.incomplete else ''}"
        f"{f', thrown away of senders served last {inputs.thrown_away}' if inputs.thrown_away else ''}"
        f"{f', connections broken {inputs.broken} (a message above 256 kB?)' if inputs.broken else ''}"
    )


def summary(status: Status) -> str:
    """Sum up a service when it ends."""
    recognizers = status.outcomes.recognizers
    return (
        f"{counts(status)}\n"
        f"{recognizers.hops} answers of {recognizers.frames} frames, {recognizers.restarts} windows started anew, "
        f"{status.unsent} answers not sent, {f'{status.stale} too old to be sent, ' if status.stale else ''}"
        f"hop {status.hop_p50 * 1000:.2f} ms (p50) {status.hop_p99 * 1000:.2f} ms (p99)"
        + "".join(f"\n{refused_frames(name, why)}" for name, why in status.refused.items())
        + "".join(f"\n{printable(note)}" for note in status.notes)
    )
