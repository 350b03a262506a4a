"""A running recogniser as the user sees it: a table, or a line for each change; a summary at the end."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.text import Text

from kinespace.stream.outputs.sink import Sink
from kinespace.stream.recognition import EventKind
from kinespace.stream.teaching.notices import State, Step
from kinespace.stream.teaching.wire import as_line
from kinespace.tools.terminal.console import console, printable
from kinespace.tools.terminal.tables import narrow_table, shortened

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rich.table import Table

    from kinespace.stream.recognition import Event, Recognition
    from kinespace.stream.status import Status
    from kinespace.stream.teaching.notices import Notice

#: Characters of a full score bar, and of the shortest useful bar.
_BAR, _MIN_BAR = 20, 5
#: Characters of a performer's name at most, of a class's name at least, and of the heading above classes.
_PERFORMER, _CLASS, _HEADING = 16, 8, len("this moment")
#: Characters between two columns.
_BETWEEN = 2
#: Notices of teaching, and ended motions of each performer, that are shown, at most.
_NOTICES, _MOTIONS = 3, 3
#: Seconds without an answer after which a performer sends no frames.
_NO_FRAMES = 0.5
#: The counters of a status, and the path to each; after the first eight only counters above 0 are shown.
COUNTERS = (
    ("received", "inputs.received"),
    ("malformed", "inputs.malformed"),
    ("foreign", "inputs.foreign"),
    ("overrun", "inputs.overrun"),
    ("missing", "inputs.missing"),
    ("out of order", "outcomes.recognizers.out_of_order"),
    ("other joints", "outcomes.other_joints"),
    ("no room", "outcomes.no_room"),
    ("performers gone", "outcomes.dropped"),
    ("from other senders", "admission.other_sender"),
    ("not let in", "admission.not_allowed"),
    ("odd times", "admission.odd_times"),
    ("incomplete", "inputs.incomplete"),
    ("dropped from senders served last", "inputs.thrown_away"),
    ("answers not sent", "unsent"),
    ("connections broken", "inputs.broken"),
)
_ALWAYS = 8


def score_shown(score: float, bar: int) -> Text:
    """Show a score from 0 to 1, behind a bar of so many characters."""
    number = Text(f"{score:.3f}")
    if not bar:
        return number
    filled = round(min(max(score, 0.0), 1.0) * bar)
    return Text("█" * filled, style="green") + Text("░" * (bar - filled) + " ", style="dim") + number


class _Widths(NamedTuple):
    """Widths of the columns of performers, classes and bars, and the figures for which there is room.

    Names are shortened to make room for the figures; only on a terminal of few characters some figures are left out.
    """

    performer: int
    name: int
    bar: int
    figures: Sequence[str]

    @classmethod
    def of(cls, width: int, performers: Sequence[str], classes: Sequence[str]) -> _Widths:
        performer = min(max(map(len, ("performer", *performers))), _PERFORMER)
        longest = max(map(len, classes), default=0)
        figures = {"score": len("0.000"), "margin": len("margin"), "frames/s": len("frames/s")}
        # The last column is followed by a space, too.
        room = width - 1 - performer - 2 * _BETWEEN - sum(figures.values()) - len(figures) * _BETWEEN
        while room < 2 * max(_CLASS, _HEADING) and len(figures) > 1:
            room += _BETWEEN + figures.popitem()[1]
        wanted = max(longest, _HEADING)
        left = room - 2 * wanted - 1
        least = _MIN_BAR if room - _MIN_BAR - 1 >= 2 * _HEADING else 0
        bar = min(max(left, least), _BAR)
        name = min(wanted, (room - (bar + 1 if bar else 0)) // 2)
        return cls(performer, max(name, _CLASS), bar, list(figures))


class _Silence:
    """Knows since when each performer was not answered."""

    def __init__(self) -> None:
        self._answered: dict[str, float] = {}

    def note(self, performer: str) -> None:
        """Note that a performer was answered now."""
        self._answered[performer] = time.monotonic()

    def of(self, performers: Iterable[str]) -> dict[str, float]:
        """Give the seconds of silence of those who are silent, and forget all others than these performers."""
        now = time.monotonic()
        self._answered = {name: self._answered[name] for name in performers if name in self._answered}
        return {name: now - last for name, last in list(self._answered.items()) if now - last > _NO_FRAMES}


class PlainLines(Sink):
    """A sink that prints a line whenever a performer's label changes; times count from the performer's first answer."""

    def __init__(self) -> None:
        #: Each performer's last label, and the times of the first and the last answer.
        self._last: dict[str, tuple[str, float, float]] = {}
        self._notes: set[str] = set()
        self._silence = _Silence()
        #: The notes on performers at the last status.
        self._said: list[str] = []

    def publish(self, recognition: Recognition) -> None:
        """Print the recognition if its label is new."""
        before, began, _ = self._last.get(recognition.performer, ("", recognition.time, 0.0))
        self._last[recognition.performer] = recognition.label, began, recognition.time
        self._silence.note(recognition.performer)
        if recognition.label != before:
            console.print(
                f"{recognition.time - began:10.3f} s  {printable(recognition.performer)}  {recognition.label}  "
                f"score {recognition.score:.3f}  margin {recognition.margin:.3f}",
                soft_wrap=True,
            )

    def publish_gone(self, performer: str) -> None:
        """Print that a performer has left."""
        console.print(f"performer {printable(performer)}: gone", soft_wrap=True)

    def publish_event(self, event: Event) -> None:
        """Print the event at the time of the performer's last answer, and its own time if that was earlier."""
        _, began, last = self._last.get(event.performer, ("", event.time, event.time))
        at = "" if event.time >= last else f" at {event.time - began:.3f} s"
        console.print(
            f"{max(event.time, last) - began:10.3f} s  {printable(event.performer)}  {event.kind}: {event.label}{at}",
            soft_wrap=True,
        )

    def publish_status(self, status: Status) -> None:
        """Forget performers that have left, so that their return is printed."""
        self._last = {name: last for name, last in self._last.items() if name in status.performers}
        said = said_of(status) + [f"performer {printable(name)}: no frames" for name in self._silence.of(self._last)]
        for line in said:
            if line not in self._said:
                console.print(line, soft_wrap=True)
        self._said = said
        for note in status.notes:
            # A sender may make a new mistake each second: one line of each kind is enough.
            kind = note.partition(":")[0]
            if kind not in self._notes:
                self._notes.add(kind)
                console.print(printable(note), soft_wrap=True)

    def publish_notice(self, notice: Notice) -> None:
        """Print the notice."""
        console.print(printable(as_line(notice)), soft_wrap=True, markup=False)


class LiveTable(Sink):
    """A sink that keeps the content of the table: the last recognition of each performer, the last status."""

    def __init__(self, classes: Sequence[str]) -> None:
        self._classes = classes
        #: The performer in each row; empty when the performer has left, until a newcomer takes the row.
        self._rows: list[str] = []
        self._latest: dict[str, Recognition] = {}
        self._going_on: dict[str, Event] = {}
        self._silence = _Silence()
        #: For each performer the last ended motions, with their lengths.
        self._over: dict[str, tuple[str, ...]] = {}
        self._status: Status | None = None
        #: The line below the table while `live` can be taught.
        self.hint = ""
        self._taught: list[Notice] = []

    def publish_notice(self, notice: Notice) -> None:
        """Keep the last notices; of how a lesson waits the newest alone."""
        waits = isinstance(notice, State) and notice.step is Step.WAITING
        kept = [each for each in self._taught if not (waits and isinstance(each, State) and each.step is Step.WAITING)]
        self._taught = [*kept, notice][-_NOTICES:]

    def publish(self, recognition: Recognition) -> None:
        """Keep the recognition."""
        name = recognition.performer
        self._latest[name] = recognition
        self._silence.note(name)
        if name not in self._rows:
            place = self._rows.index("") if "" in self._rows else len(self._rows)
            self._rows[place : place + 1] = [name]

    def publish_event(self, event: Event) -> None:
        """Keep the motion that goes on, and ended ones."""
        if event.kind is EventKind.START:
            self._going_on[event.performer] = event
        elif begun := self._going_on.pop(event.performer, None):
            over = f"{shortened(event.label, _PERFORMER)} {event.time - begun.time:.1f} s"
            self._over[event.performer] = (*self._over.get(event.performer, ()), over)[-_MOTIONS:]

    def publish_classes(self, classes: Sequence[str]) -> None:
        """Keep the classes."""
        self._classes = classes

    def publish_status(self, status: Status) -> None:
        """Keep the status, and forget performers that have left; the others keep their rows."""
        self._status = status
        here = status.performers
        rows = [name if name in here else "" for name in self._rows]
        while rows and not rows[-1]:
            del rows[-1]
        self._rows = rows
        self._latest = {name: last for name, last in self._latest.items() if name in here}
        self._going_on = {name: event for name, event in self._going_on.items() if name in here}
        self._over = {name: over for name, over in self._over.items() if name in here}

    def drawn(self) -> Table:
        """Draw the current table; from any thread."""
        rows, latest, rates = list(self._rows), dict(self._latest), self._status.performers if self._status else {}
        going_on, silent = dict(self._going_on), self._silence.of(latest)
        table = narrow_table("kinespace live", self._caption(silent))
        widths = _Widths.of(console.width, [printable(name) for name in rows], self._classes)
        for heading in ("performer", "doing", "this moment"):
            table.add_column(heading, no_wrap=True)
        for heading in widths.figures:
            table.add_column(heading, justify="left" if heading == "score" else "right", no_wrap=True)
        for name in rows:
            last = latest.get(name)
            if last is None:
                table.add_row()
                continue
            cells = {
                "score": score_shown(last.score, widths.bar),
                "margin": Text(f"{last.margin:.3f}"),
                "frames/s": Text(f"{rates[name]:.0f}" if name in rates else ""),
            }
            doing = going_on[name].label if name in going_on else ""
            label = "no frames" if name in silent else last.label
            table.add_row(
                Text(shortened(printable(name), widths.performer)),
                Text(shortened(doing, widths.name), style="bold"),
                Text(shortened(label, widths.name), style="" if label == last.class_name else "dim"),
                *(cells[heading] for heading in widths.figures),
            )
        if not latest:
            table.add_row("", Text("waiting for frames ...", style="dim"))
        return table

    def _caption(self, silent: Mapping[str, float]) -> str:
        status = self._status
        if status is None:
            return f"{len(self._classes)} classes"
        lines = [f"{printable(name)} before: {', '.join(over)}" for name, over in list(self._over.items())]
        lines += [f"performer {printable(name)}: no frames for {seconds:.0f} s" for name, seconds in silent.items()]
        lines += [*said_of(status), *map(printable, status.notes)]
        lines += [*(printable(as_line(each)) for each in self._taught), *([self.hint] if self.hint else ())]
        return "\n".join([f"{len(self._classes)} classes · {counts(status)}", *lines])


def said_of(status: Status) -> list[str]:
    """List notes on performers' joints and clocks, and why frames are refused, a line each."""
    noticed = (*status.compared.items(), *status.clocks.items(), *status.doubted.items())
    lines = [f"performer {printable(name)}: {what}" for name, what in noticed]
    return [*lines, *(refused_frames(name, why) for name, why in status.refused.items())]


def refused_frames(performer: str, why: str) -> str:
    """Name the reason why a performer's frames are refused, and the remedy."""
    return (
        f"performer {printable(performer)}: frames refused: {why}. Let the sender send them, or say them with --joints"
    )


def counted(status: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    """Give the counters that are shown, by their words: the first of `COUNTERS`, and further ones above 0."""
    for place, (words, path) in enumerate(COUNTERS):
        count: Any = status
        for part in path.split("."):
            count = count.get(part, 0) if isinstance(count, Mapping) else 0
        if place < _ALWAYS or count:
            yield words, count


def counts(status: Status) -> str:
    """Count in one line all that came in and was lost; answers that were not sent stand in the summary."""
    counters = ", ".join(f"{words} {count}" for words, count in counted(asdict(replace(status, unsent=0))))
    return counters + (" (messages too large or too many?)" if status.inputs.broken else "")


def summary(status: Status, hop: float) -> str:
    """Sum up a service when it ends; `hop`: seconds between two answers to a performer, at least."""
    recognizers = status.outcomes.recognizers
    most = f" (--hop: at most {1 / hop:.3g} answers a second)" if hop else ""
    return (
        f"{counts(status)}\n"
        f"{recognizers.hops} answers of {recognizers.frames} frames{most}, "
        f"{recognizers.restarts} windows started anew, "
        f"{status.unsent} answers not sent, {f'{status.stale} too old to be sent, ' if status.stale else ''}"
        f"hop {status.hop_p50 * 1000:.2f} ms (p50) {status.hop_p99 * 1000:.2f} ms (p99)"
        + "".join(f"\n{refused_frames(name, why)}" for name, why in status.refused.items())
        + "".join(f"\n{printable(note)}" for note in status.notes)
    )
