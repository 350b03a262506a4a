"""The file of taught motions: a thread of its own writes the newest roster, tries again, and keeps what it replaces."""

from __future__ import annotations

import queue
import shutil
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from kinespace.library.clip import Clip
from kinespace.library.motion_library import MotionLibrary
from kinespace.library.teaching.examples import Roster
from kinespace.stream.teaching import State, Step

#: Seconds between two attempts to save, and between the ends of two saves: further changes are saved together.
_AGAIN, _TOGETHER = 1.0, 0.2
#: Seconds after which a file that a killed program left half written is deleted.
_ABANDONED = 60.0


class RosterFile:
    """Reads the taught library, and saves rosters in its place; one program at a time has it.

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
        self._path, real = path.absolute(), path.resolve()
        self._lock_path = real.with_name(f".{real.name}.lock")
        self._lock = _locked(self._lock_path, path)
        try:
            _tidy(real)
            self.library = MotionLibrary.load(path) if path.exists() else None
        except BaseException:
            self._unlock()
            raise
        #: The examples in the file, and in the copy of the file before examples were lost.
        self._before = Roster.of_library(self.library) if self.library else Roster()
        self._held = len(self._before.examples)
        self._copied = 0
        self._newest: Roster | None = None
        self._asked = self._failed = False
        self._guard, self._wake, self._ending = threading.Lock(), threading.Event(), threading.Event()
        self._said: queue.SimpleQueue[State] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="kinespace file", daemon=True)
        self._thread.start()

    @property
    def has_unsaved(self) -> bool:
        """Whether there are changes that are not in the file."""
        return self._newest is not None

    def save(self, roster: Roster, *, asked: bool = False) -> None:
        """Save a roster soon; the newest one counts. Whether somebody asked for it, and waits until it is written."""
        with self._guard:
            self._newest, self._asked = roster, self._asked or asked
        self._wake.set()

    def states(self) -> Iterator[State]:
        """Give what is to be said since the last call."""
        while not self._said.empty():
            yield self._said.get()

    def close(self) -> None:
        """Save the last changes, and let other programs have the file."""
        self._ending.set()
        self._wake.set()
        self._thread.join()
        self._unlock()

    def _work(self) -> None:
        while not self._ending.is_set():
            self._wake.wait(_AGAIN if self.has_unsaved else None)
            self._wake.clear()
            self._write()
            self._ending.wait(_TOGETHER)
        self._write()

    def _write(self) -> None:
        """Write the newest roster; a failure is said once, and tried again later."""
        with self._guard:
            roster, asked, self._asked = self._newest, self._asked, False
        if roster is None:
            return
        try:
            real = self._path.resolve()
            self._keep_copy(real, roster)
            if library := self._library(roster):
                library.save(real)
            else:
                real.unlink(missing_ok=True)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            if asked or not self._failed:
                name = self._path.name
                self._say(Step.REFUSED, f"{name} was not saved: {why}; the taught motions are still in memory")
            self._failed = True
            return
        asked, self._failed, self._held = asked or self._failed, False, len(roster.examples)
        with self._guard:
            self._newest = None if self._newest is roster else self._newest
        if asked:
            saved = f"{self._path.name} saved, examples: {self._held}"
            self._say(Step.DONE, saved if self._held else "nothing to save")

    def _keep_copy(self, file: Path, roster: Roster) -> None:
        """Keep a copy of a file that has more examples than will be there; a copy that has more yet is kept."""
        if len(roster.examples) < self._held and self._held >= self._copied and file.exists():
            shutil.copy2(file, file.with_name(f"{file.stem}.before{file.suffix}"))
            self._copied = self._held

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
        learned = before.learned and before.learned.for_other_motions()
        return MotionLibrary(library.skeleton, library.motions, learned)

    def _say(self, step: Step, reason: str) -> None:
        self._said.put(State("", step, 0.0, reason))

    def _unlock(self) -> None:
        lock, self._lock = self._lock, None
        if lock:
            self._lock_path.unlink(missing_ok=True)
            lock.close()


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


def _locked(path: Path, taught: Path) -> BinaryIO | None:
    """Lock a file as long as this program runs; None where the system has no such locks."""
    try:
        import fcntl  # noqa: PLC0415 - there is none on Windows
    except ImportError:
        return None
    file = path.open("wb")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.close()
        raise ValueError(f"{taught}: another kinespace teaches there; expected a file of its own") from error
    return file


def _tidy(path: Path) -> None:
    """Delete what a program that was killed left of a save."""
    for part in path.parent.glob(f".{path.name}.*.part"):
        if time.time() - part.stat().st_mtime > _ABANDONED:
            part.unlink(missing_ok=True)
