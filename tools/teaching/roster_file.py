"""The file of taught motions: a thread of its own writes the newest roster, tries again, and keeps what it replaces."""

import math
import queue
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from kinespace.library import Clip, MotionLibrary, library_file
from kinespace.stream.teaching import State, Step
from kinespace.stream.teaching.examples import Example, Roster

#: Seconds between two attempts to save, between the ends of two saves, and between two looks whether it is time.
_AGAIN, _TOGETHER, _LOOK = 1.0, 0.2, 0.1
#: Seconds without a change after which the whole file is written, and examples that wait for that, at most.
_QUIET, _MOST_NEW = 3.0, 64
#: Seconds after which a file that a killed program left half written is deleted.
_ABANDONED = 60.0


class RosterFile:
    """Reads the taught library, and saves rosters in its place; one program at a time has it.

    New examples are written at once into a file of their own beside the library (`library_file.beside`), which every
    reader of the library adds to it: writing all examples takes a second. They come into the file itself when nothing
    has changed for some seconds, at the end, and with every other change.

    Parameters
    ----------
    path
        The file; it may be missing. A symbolic link stays one.

    Attributes
    ----------
    library
        The library in the file when it was opened; None where there was no file.

    Raises
    ------
    ValueError
        The file is no library, or another program teaches there.
    OSError
        The file cannot be read, or its folder is missing or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        if not path.absolute().parent.is_dir():
            raise FileNotFoundError(f"{path}: no such folder")
        if not path.exists():
            library_file.require_name(path)
        self._path, self._new_path = path.absolute(), library_file.beside(path, "new")
        with ExitStack() as opened:
            opened.enter_context(library_file.locked(path, for_long=True))
            _tidy(path.resolve())
            self.library = MotionLibrary.load(path) if path.exists() else None
            if self.library and self._new_path.exists():
                library_file.write(path.resolve(), self.library.contents)
            self._new_path.unlink(missing_ok=True)
            self._lock = opened.pop_all()
        #: The examples that the file had, that are in the file itself now with their library, that would survive now,
        #: that were looked at for new ones, and the newest, with the moment since which they are.
        kept = Roster.of_library(self.library) if self.library else Roster()
        self._before = self._in_file = self._safe = self._looked_at = self._newest = kept
        self._written, self._since = self.library, -math.inf
        #: Examples in the copy of the file before examples were lost.
        self._copied = 0
        self._asked = self._failed = self._ending = False
        #: Woken by every change; and held while the file of new examples is written or goes.
        self._wake, self._adding = threading.Condition(), threading.Lock()
        self._said: queue.SimpleQueue[State] = queue.SimpleQueue()
        works = {"examples": self._add, "file": self._work}.items()
        self._threads = [threading.Thread(target=work, name=f"kinespace {name}", daemon=True) for name, work in works]
        for thread in self._threads:
            thread.start()

    @property
    def has_unsaved(self) -> bool:
        """Whether there are changes that would be lost."""
        return self._newest is not self._safe

    def save(self, roster: Roster, *, asked: bool = False) -> None:
        """Save a roster soon; the newest one counts. Whether somebody asked for it, and waits until it is written."""
        with self._wake:
            self._newest, self._since, self._asked = roster, time.monotonic(), self._asked or asked
            self._wake.notify_all()

    def states(self) -> Iterator[State]:
        """Give what is to be said since the last call."""
        while not self._said.empty():
            yield self._said.get()

    def close(self) -> None:
        """Save the last changes, and let other programs have the file."""
        with self._wake:
            self._ending = True
            self._wake.notify_all()
        for thread in self._threads:
            thread.join()
        self._lock.close()

    def _wait(self, until: Callable[[], bool], longest: float | None = None) -> None:
        with self._wake:
            self._wake.wait_for(lambda: self._ending or until(), longest)

    def _add(self) -> None:
        """Write new examples beside the file, whenever there are some."""
        while not self._ending:
            self._wait(lambda: self.has_unsaved)
            with self._adding:
                self._looked_at = self._newest
                self._write_new(self._looked_at)
            # The other thread has to write what cannot be added.
            self._wait(lambda: self._newest is not self._looked_at)

    def _write_new(self, roster: Roster) -> bool:
        """Write the examples that the file lacks beside it, if nothing else has changed; say whether that was done."""
        new = self._new(roster)
        if not new or self._written is None:
            return False
        skeleton = self._written.skeleton
        try:
            motions = MotionLibrary.of_clips([_completed(each.motion, self._written) for each in new]).motions
            added = tuple(each.restricted_to(skeleton.joints).as_of(skeleton) for each in motions)
            library_file.write(self._new_path, (skeleton, added, {}), compressed=False)
        except (OSError, ValueError):
            # The other thread is to try at once, and says why it fails.
            self._since = -math.inf
            return False
        self._safe = roster
        return True

    def _new(self, roster: Roster) -> list[Example] | None:
        """Give the examples that the file lacks; None where anything else has changed."""
        before = {*map(_key, self._in_file.examples)}
        new = [each for each in roster.examples if _key(each) not in before]
        return new if len(new) + len(before) == len(roster.examples) else None

    def _is_due(self) -> bool:
        """Say whether the file itself is to be written now."""
        if self._newest is self._in_file:
            # A new example that was undone still lies beside the file.
            return self._asked or self.has_unsaved
        new = None if self._asked or self._written is None else self._new(self._newest)
        return new is None or len(new) > _MOST_NEW or time.monotonic() - self._since > _QUIET

    def _work(self) -> None:
        while not self._ending:
            self._wait(lambda: self._newest is not self._in_file or self._asked or self.has_unsaved)
            self._wait(self._is_due, _LOOK)
            if self._is_due():
                self._write()
                self._wait(lambda: False, _AGAIN if self._failed else _TOGETHER)
        if self._newest is not self._in_file or self.has_unsaved:
            self._write()

    def _write(self) -> None:
        """Write the newest roster; a failure is said once, and tried again later."""
        with self._wake:
            roster, asked, self._asked = self._newest, self._asked, False
        try:
            real = self._path.resolve()
            self._keep_copy(real, roster)
            if library := self._library(roster):
                library_file.write(real, library.contents)
            else:
                real.unlink(missing_ok=True)
            with self._adding:
                before, self._in_file, self._safe, self._written = self._in_file, roster, roster, library
                try:
                    if not self._write_new(self._newest):
                        self._new_path.unlink(missing_ok=True)
                except OSError:
                    # Readers would add its examples twice: all is tried again.
                    self._in_file = before
                    raise
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            if asked or not self._failed:
                name = self._path.name
                self._say(Step.REFUSED, f"{name} was not saved: {why}; the taught motions are still in memory")
            self._failed = True
            return
        asked, self._failed = asked or self._failed, False
        if asked:
            saved = f"{self._path.name} saved, examples: {len(roster.examples)}"
            self._say(Step.DONE, saved if roster.examples else "nothing to save")

    def _keep_copy(self, file: Path, roster: Roster) -> None:
        """Keep a copy of a file that has more examples than will be there; a copy that has more yet is kept."""
        held = len(self._in_file.examples)
        if len(roster.examples) < held and held >= self._copied and file.exists():
            shutil.copy2(file, file.with_name(f"{file.stem}.before{file.suffix}"))
            self._copied = held

    def _library(self, roster: Roster) -> MotionLibrary | None:
        """Make a library of a roster; what was in the file and is not touched stays as it was."""
        before = self.library
        if before is None or not roster.examples:
            return roster.library()
        known = {each.number: each.recording for each in self._before.examples}
        motions: list[Clip] = []
        for each in roster.examples:
            own = known.get(each.number)
            if own is None or each.begin > 0.0 or each.end < own.duration:
                motions.append(_completed(each.motion, before))
            else:
                motions.append(own if own.class_name == each.class_name else replace(own, class_name=each.class_name))
        if {id(each) for each in motions} == {id(each) for each in before.motions}:
            return before
        library = MotionLibrary.of_clips(motions)
        return replace(library, learned=library_file.for_other_motions(before.learned))

    def _say(self, step: Step, reason: str) -> None:
        self._said.put(State("", step, 0.0, reason))


def _key(example: Example) -> tuple[int, str, float, float, int]:
    """Tell an example from others; the one that was read is another object than the one that was shown."""
    return example.number, example.class_name, example.begin, example.end, example.recording.frames


def _completed(clip: Clip, library: MotionLibrary) -> Clip:
    """Give a motion all joints of a library: a joint that was not recorded stands where the nearest one is."""
    joints = library.skeleton.joints
    if set(joints) <= set(clip.skeleton.joints):
        return clip.restricted_to(joints).as_of(library.skeleton)
    body = np.mean([motion.positions.mean(axis=0) for motion in library.motions], axis=0)
    there = [place for place, name in enumerate(joints) if name in clip.skeleton.joints]
    distances = np.linalg.norm(body[:, None] - body[there], axis=2)
    places = [clip.skeleton.joints.index(joints[there[nearest]]) for nearest in distances.argmin(axis=1).tolist()]
    return replace(clip, skeleton=library.skeleton, positions=clip.positions[:, places])


def _tidy(path: Path) -> None:
    """Delete what a program that was killed left of a save."""
    for part in path.parent.glob(f".{path.name}.*.part"):
        if time.time() - part.stat().st_mtime > _ABANDONED:
            part.unlink(missing_ok=True)
