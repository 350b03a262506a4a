"""Keys for teaching while the table is shown, for a performer who is alone with a keyboard."""

import os
import sys
import threading
from codecs import getincrementaldecoder
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Self

from kinespace.library import NOTHING
from kinespace.stream.teaching import Asked, Command, commands
from kinespace.tools.cli.live_table import LiveTable
from kinespace.tools.teaching.lessons import Lessons

#: Seconds between two checks for a key.
_LOOK = 0.1
#: Bytes of keys that are read at once, at most.
_AT_ONCE = 1024
HINT = (
    "t teach a new motion · a another example · h hold: record a new motion now, h again ends it · "
    "= name the last motion · 1 to 9 choose the performer · y the last name was right · n it was wrong · "
    "m move as you will: nothing · space stop · x cancel · u undo · s save"
)
_PLAIN: dict[str, Command] = {"x": commands.Cancel(), " ": commands.Stop(), "u": commands.Undo(), "s": commands.Save()}
#: Keys that say whether the last name was right.
_JUDGED: dict[str, Callable[[str], Command]] = {"y": commands.Right, "n": commands.Wrong}


class Keys:
    """Reads keys from a terminal on standard input; a context manager.

    Parameters
    ----------
    lessons
        Knows the classes and the performers.
    shown
        Shows the list of keys.
    ask
        Takes each command, in the keys' own thread.
    """

    def __init__(self, lessons: Lessons, shown: LiveTable, ask: Callable[[Asked], object]) -> None:
        self._lessons, self._shown, self._ask = lessons, shown, ask
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="kinespace keys", daemon=True)
        self._taught, self._held, self._whose = "", False, ""
        #: The name that is being typed; None while keys are commands.
        self._typed: str | None = None

    def __enter__(self) -> Self:
        if sys.stdin.isatty() and sys.platform != "win32":
            self._shown.hint = HINT
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def command_of(self, key: str) -> Command | None:
        """Give a key's command; new motions are numbered until they are named."""
        if self._typed is not None:
            return self._named(key)
        if key in "123456789" and int(key) <= len(performers := self._lessons.performers.names):
            self._whose = performers[int(key) - 1]
            self._shown.hint = f"{self._whose} is taught · {HINT}"
        if key == "=" and self._taught:
            self._typed = ""
            self._shown.hint = f"{self._taught} is called: "
        if key == "t" or (key == "h" and not self._held) or (key == "a" and not self._taught):
            names = (f"motion {number}" for number in count(1))
            self._taught = next(name for name in names if name not in self._lessons.classes)
        if key in ("t", "a"):
            return commands.Teach(self._whose, self._taught)
        if key == "h":
            # A terminal does not say when a key is released.
            self._held = not self._held
            return commands.Hold(self._whose, self._taught, self._held)
        if key == "m":
            return commands.Teach(self._whose, NOTHING)
        return _JUDGED[key](self._whose) if key in _JUDGED else _PLAIN.get(key)

    def _named(self, key: str) -> Command | None:
        """Take in a letter of the last motion's name; Enter ends it, Escape forgets it."""
        typed = self._typed or ""
        if key not in "\n\r\x1b":
            self._typed = typed[:-1] if key in "\x7f\b" else typed + key
            self._shown.hint = f"{self._taught} is called: {self._typed}"
            return None
        self._typed, self._shown.hint, before = None, HINT, self._taught
        if key == "\x1b" or not typed.strip():
            return None
        self._taught = typed.strip()
        try:
            return commands.Rename(before, self._taught)
        except commands.CommandError:
            self._taught = before
            return None

    def _read(self) -> None:
        import select  # noqa: PLC0415 - only on systems with such terminals
        import termios  # noqa: PLC0415 - as above
        import tty  # noqa: PLC0415 - as above

        before, letters = termios.tcgetattr(sys.stdin), getincrementaldecoder(sys.stdin.encoding)("replace")
        tty.setcbreak(sys.stdin)
        try:
            while not self._ended.is_set():
                if not select.select([sys.stdin], [], [], _LOOK)[0]:
                    continue
                # What Python's own text stream has read, `select` does not see.
                if not (typed := os.read(sys.stdin.fileno(), _AT_ONCE)):
                    break  # the terminal has gone
                for key in letters.decode(typed):
                    if command := self.command_of(key):
                        self._ask(Asked(command))
        finally:
            with suppress(termios.error):
                termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
