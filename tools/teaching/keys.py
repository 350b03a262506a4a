"""Keys for teaching while the table is shown, for a performer who is alone with a keyboard."""

from __future__ import annotations

import sys
import threading
from typing import Self

from kinespace.library.motion_library import NOTHING
from kinespace.stream.teaching import Asked, Command, commands
from kinespace.tools.teaching.lessons import Lessons
from kinespace.tools.terminal.live_table import LiveTable

#: Seconds between two checks for a key.
_LOOK = 0.1
HINT = (
    "t teach a new motion · a another example · h hold: record now, h again ends it · y the last name was right · "
    "n it was wrong · m move as you will: nothing · space stop · x cancel · u undo · r redo · s save"
)
_PLAIN: dict[str, Command] = {
    " ": commands.Stop(),
    "x": commands.Cancel(),
    "u": commands.Undo(),
    "r": commands.Redo(),
    "s": commands.Save(),
    "y": commands.Right(),
    "n": commands.Wrong(),
    "m": commands.Teach("", NOTHING),
}


class Keys:
    """Reads keys from a terminal on standard input; a context manager.

    Parameters
    ----------
    lessons
        Carries out the commands, and knows the classes.
    shown
        Shows the list of keys.
    """

    def __init__(self, lessons: Lessons, shown: LiveTable) -> None:
        self._lessons, self._shown = lessons, shown
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._read, name="kinespace keys", daemon=True)
        self._taught, self._held = 0, False

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
        """Give a key's command; new motions are numbered, to be renamed later."""
        if key == "t":
            names = self._lessons.classes
            self._taught = next(number for number in range(1, len(names) + 2) if f"motion {number}" not in names)
        name = f"motion {max(self._taught, 1)}"
        if key in ("t", "a"):
            return commands.Teach("", name)
        if key == "h":
            # A terminal does not say when a key is released.
            self._held = not self._held
            return commands.Hold("", name, self._held)
        return _PLAIN.get(key)

    def _read(self) -> None:
        import select  # noqa: PLC0415 - only on systems with such terminals
        import termios  # noqa: PLC0415 - as above
        import tty  # noqa: PLC0415 - as above

        before = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin)
        try:
            while not self._ended.is_set():
                if select.select([sys.stdin], [], [], _LOOK)[0]:
                    command = self.command_of(sys.stdin.read(1))
                    if command:
                        self._lessons.ask(Asked(command))
        finally:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
