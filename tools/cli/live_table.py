"""A running recogniser as the user sees it: a table, or a line for each change; a summary at the end."""

import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter

from rich.table import Table
from rich.text import Text

from kinespace.library.naming.hdm05 import title_of
from kinespace.stream import Done, Event, EventKind, Recognition
from kinespace.stream.osc import address_part
from kinespace.stream.outputs.sink import Sink
from kinespace.stream.recognition import Classes, Gone
from kinespace.stream.status import Status
from kinespace.stream.teaching.commands import Notice, State, Step, as_line
from kinespace.tools.cli.console import console, say, shortened, table_of
from kinespace.tools.cli.values import printable

#: Characters of a score's bar.
_BAR = 20
#: Characters of a terminal that has room for bars.
_WIDE = 110
#: Characters of a performer's name, at most.
_PERFORMER = 16
#: Characters of a class's name, at least.
_CLASS = 8
#: Characters of three figures, their headings, and the spaces after six columns, without bars.
_FIGURES = 5 + len("margin") + len("frames/s") + 11
#: Notices of teaching that are shown, at most.
_NOTICES = 3
#: Mistakes of senders that `--plain` says, at most.
_MOST_MISTAKES = 20
#: Ended motions of each performer that are shown, at most.
_MOTIONS = 3
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
    ("while the library opens", "outcomes.opening"),
    ("from other senders", "admission.other_sender"),
    ("not allowed", "admission.not_allowed"),
    ("odd times", "admission.odd_times"),
    ("incomplete", "inputs.incomplete"),
    ("dropped from senders served last", "inputs.thrown_away"),
    ("dropped for newer ones", "inputs.stale"),
    ("answers not sent", "unsent"),
    ("connections broken", "inputs.broken"),
)


def score_shown(score: float, width: int) -> Text:
    """Show a score from 0 to 1, behind a bar where a terminal has room for it: at `_WIDE` characters."""
    number = Text(f"{score:.3f}")
    if width < _WIDE:
        return number
    filled = round(min(max(score, 0.0), 1.0) * _BAR)
    return Text("█" * filled, style="green") + Text("░" * (_BAR - filled) + " ", style="dim") + number


class _Silence:
    """Knows since when each performer was not answered."""

    def __init__(self) -> None:
        self._answered: dict[str, float] = {}
        self._opening = 0

    def waits(self, status: Status) -> None:
        """Count performers who send as answered where frames have come while the library opened."""
        if status.outcomes.opening != self._opening:
            self._opening = status.outcomes.opening
            self._answered |= {name: time.monotonic() for name, rate in status.performers.items() if rate > 0}

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

    def publish_recognition(self, recognition: Recognition) -> None:
        """Print the recognition if its label is new."""
        before, began, _ = self._last.get(recognition.performer, ("", recognition.time, 0.0))
        # A sender's clock may begin again.
        began = min(began, recognition.time)
        self._last[recognition.performer] = recognition.label, began, recognition.time
        self._silence.note(recognition.performer)
        if recognition.label != before:
            name, label, score = recognition.performer, recognition.label, recognition.score
            facts = _facts("label", name, label, score=round(score, 4))
            measured = f"score {score:.3f}  margin {recognition.margin:.3f}"
            say(f"{recognition.time - began:10.3f} s  {name}  {label}  {measured}", facts)

    def publish_gone(self, gone: Gone) -> None:
        """Print that a performer has left."""
        say(f"performer {gone.performer}: gone", {"what": "gone", "performer": gone.performer})

    def publish_event(self, event: Event) -> None:
        """Print the event at the time of the performer's last answer, and its own time if that was earlier."""
        _, began, last = self._last.get(event.performer, ("", event.time, event.time))
        at = "" if event.time >= last else f" at {event.time - began:.3f} s"
        moment = max(event.time, last) - began
        facts = _facts(event.kind, event.performer, event.label)
        say(f"{moment:10.3f} s  {event.performer}  {event.kind}: {event.label}{at}", facts)

    def publish_done(self, done: Done) -> None:
        """Print the motion that was done, at the time of the performer's last answer."""
        _, began, last = self._last.get(done.performer, ("", done.start, done.end))
        how = f"{done.duration:.1f} s, speed {done.speed:.2f}, amplitude {done.amplitude:.2f}"
        facts = _facts("done", done.performer, done.label, count=done.count)
        say(f"{last - began:10.3f} s  {done.performer}  done: {done.label} {done.count}, {how}", facts)

    def publish_status(self, status: Status) -> None:
        """Forget performers that have left, so that their return is printed."""
        self._last = {name: last for name, last in self._last.items() if name in status.performers}
        self._silence.waits(status)
        silent = [f"performer {name}: no frames" for name in self._silence.of(self._last)]
        said = [*said_of(status), *addresses(status), *silent]
        for line in said:
            if line not in self._said:
                say(line, level="warning")
        self._said = said
        for note in status.notes:
            # A sender may make a mistake each second: one line for each thing expected is enough, and few in all.
            mistake = note.partition(", got")[0]
            if mistake not in self._notes and len(self._notes) < _MOST_MISTAKES:
                self._notes.add(mistake)
                say(note, level="warning")

    def publish_state(self, notice: Notice) -> None:
        """Print the notice."""
        say(as_line(notice))

    publish_taught = publish_state


def _facts(what: str, performer: str, class_name: str, **numbers: float) -> dict[str, object]:
    """Give the facts of a line for a log."""
    return {"what": what, "performer": performer, "class": class_name, **numbers}


@dataclass(slots=True)
class _Shown:
    """What is shown of a performer."""

    latest: Recognition | None = None
    going_on: Event | None = None
    #: The last ended motions, with their lengths.
    over: tuple[str, ...] = ()
    #: The motions that were done, by class, the last ones last.
    done: dict[str, int] = field(default_factory=dict)


class LiveTable(Sink):
    """A sink that keeps the content of the table: the last answers to each performer, the last status."""

    def __init__(self, classes: Sequence[str]) -> None:
        self._classes = tuple(classes)
        #: The performer in each row; empty when the performer has left, until a newcomer takes the row.
        self._rows: list[str] = []
        self._shown = defaultdict[str, _Shown](_Shown)
        self._silence = _Silence()
        self._status: Status | None = None
        #: The line below the table while `live` can be taught.
        self.hint = ""
        self._taught: list[Notice] = []

    def publish_state(self, notice: Notice) -> None:
        """Keep the last notices; of how a lesson waits the newest alone."""
        waits = isinstance(notice, State) and notice.step is Step.WAITING
        kept = [each for each in self._taught if not (waits and isinstance(each, State) and each.step is Step.WAITING)]
        self._taught = [*kept, notice][-_NOTICES:]

    publish_taught = publish_state

    def publish_recognition(self, recognition: Recognition) -> None:
        """Keep the recognition."""
        name = recognition.performer
        self._shown[name].latest = recognition
        self._silence.note(name)
        if name not in self._rows:
            place = self._rows.index("") if "" in self._rows else len(self._rows)
            self._rows[place : place + 1] = [name]

    def publish_event(self, event: Event) -> None:
        """Keep the motion that goes on, and ended ones."""
        shown = self._shown[event.performer]
        if event.kind is EventKind.END and shown.going_on:
            over = f"{shortened(title_of(event.label), _PERFORMER)} {event.time - shown.going_on.time:.1f} s"
            shown.over = (*shown.over, over)[-_MOTIONS:]
        shown.going_on = event if event.kind is EventKind.START else None

    def publish_done(self, done: Done) -> None:
        """Keep how often the class was done."""
        shown = self._shown[done.performer]
        shown.done = {name: count for name, count in shown.done.items() if name != done.label}
        shown.done[done.label] = done.count

    def publish_classes(self, classes: Classes) -> None:
        """Keep the classes."""
        self._classes = classes.names

    def publish_status(self, status: Status) -> None:
        """Keep the status, and forget performers that have left; the others keep their rows."""
        self._status = status
        self._silence.waits(status)
        here = status.performers
        rows = [name if name in here else "" for name in self._rows]
        while rows and not rows[-1]:
            del rows[-1]
        self._rows = rows
        for name in self._shown.keys() - here.keys():
            del self._shown[name]

    def drawn(self) -> Table:
        """Draw the current table; from any thread."""
        rows, shown, rates = list(self._rows), dict(self._shown), self._status.performers if self._status else {}
        answered = {name: each.latest for name, each in shown.items() if each.latest}
        silent = self._silence.of(answered)
        width, longest = console.width, min(max(map(len, (*rows, "performer"))), _PERFORMER)
        room = max((width - longest - _FIGURES - (_BAR + 1 if width >= _WIDE else 0)) // 2, _CLASS)
        cells = list["Sequence[str | Text]"]()
        for name in rows:
            last = answered.get(name)
            if last is None:
                cells.append(())
                continue
            doing = title_of(begun.label) if (begun := shown[name].going_on) else ""
            label = "no frames" if name in silent else title_of(last.label)
            cells.append(
                (
                    shortened(name, _PERFORMER),
                    Text(shortened(doing, room), style="bold"),
                    Text(shortened(label, room), style="" if last.class_name and name not in silent else "dim"),
                    score_shown(last.score, width),
                    f"{last.margin:.3f}",
                    f"{rates[name]:.0f}" if name in rates else "",
                )
            )
        if not answered:
            cells.append(("", Text(self._waiting(), style="dim")))
        headings = ("performer", "doing", "this moment", "score", "margin", "frames/s")
        return table_of("kinespace live", headings, cells, caption=self._caption(shown, silent), names=3)

    def _waiting(self) -> str:
        """Say what is waited for while nobody is answered."""
        status = self._status
        if status and status.performers and not self._classes:
            return "frames come; no motion is taught yet"
        if status and status.performers:
            return "frames come, no answer yet"
        listened = ", ".join(status.listening) if status else ""
        return f"waiting for frames on {listened} ..." if listened else "waiting ..."

    def _caption(self, shown: Mapping[str, _Shown], silent: Mapping[str, float]) -> str:
        status = self._status
        if status is None:
            return f"{len(self._classes)} class{'es' if len(self._classes) != 1 else ''}"
        lines = [f"{name} before: {', '.join(each.over)}" for name, each in shown.items() if each.over]
        for name, done in ((name, list(each.done.items())[-_MOTIONS:]) for name, each in shown.items() if each.done):
            lines.append(f"{name} done: {', '.join(f'{title_of(label)} {count}' for label, count in done)}")
        lines += [f"performer {name}: no frames for {seconds:.0f} s" for name, seconds in silent.items()]
        lines += [*said_of(status), *addresses(status), *status.notes]
        lines += [*(as_line(each) for each in self._taught), *([self.hint] if self.hint else ())]
        return "\n".join(map(printable, [f"{len(self._classes)} classes · {counts(status)}", *lines]))


def said_of(status: Status) -> list[str]:
    """List notes on performers' joints and clocks, and why frames are refused, a line each."""
    noticed = (*status.compared.items(), *status.clocks.items(), *status.doubted.items())
    lines = [f"performer {name}: {what}" for name, what in noticed]
    if status.answered < 1:
        lines.append(f"this machine is too slow: {status.answered:.0%} of the answers are given")
    return [*lines, *(refused_frames(name, why) for name, why in status.refused.items())]


def addresses(status: Status) -> list[str]:
    """Say which performer has which OSC address where that is not plain, a line each."""
    return [
        f"performer {printable(name)}: OSC answers at /motion/{printable(at)}/..."
        for name in status.performers
        if (at := address_part(name)) != name or not name.isascii()
    ]


def promise(promised: float, missed: float | None) -> str:
    """Say what is promised of motions that were done, and what it costs; nothing where none is said."""
    cost = "" if missed is None else f", {missed:.0%} of the library's own motions missed"
    return f"done: ≤ {promised:g} false/h promised{cost}" if promised else ""


def refused_frames(performer: str, why: str) -> str:
    """Name the reason why a performer's frames are refused."""
    return f"performer {performer}: frames refused: {why}"


def counted(status: Status) -> Iterator[tuple[str, int]]:
    """Give the counters that are shown, by their words: all that came in, and further ones above 0."""
    for words, path in COUNTERS:
        if (count := attrgetter(path)(status)) or words == "received":
            yield words, count


def counts(status: Status) -> str:
    """Count in one line all that came in and was lost; answers that were not sent stand in the summary."""
    counters = ", ".join(f"{words} {count}" for words, count in counted(replace(status, unsent=0)))
    return counters + (" (messages too large or too many?)" if status.inputs.broken else "")


def summary(status: Status, hop: float, *, notes: bool = True) -> list[str]:
    """Sum up a service when it ends; `hop`: seconds between two answers to a performer, at least.

    `PlainLines` has said the notes already.
    """
    recognizers = status.outcomes.recognizers
    most = f" (--hop: at most {1 / hop:.3g} answers a second)" if hop else ""
    said = (
        f"{recognizers.hops} answers of {recognizers.frames} frames{most}, "
        f"{recognizers.restarts} windows started again, "
        f"{status.unsent} answers not sent, {f'{recognizers.skipped} left out, ' if recognizers.skipped else ''}"
        f"hop {status.hop_p50 * 1000:.2f} ms (p50) {status.hop_p99 * 1000:.2f} ms (p99)"
    )
    last = [*(refused_frames(name, why) for name, why in status.refused.items()), *status.notes]
    return [counts(status), said, *(last if notes else ())]
