"""The command line `kinespace PROGRAM`: finds the program, runs it, and turns its failure into one line.

A program is a module with two functions: `add_arguments(parser)` adds its options, and `run(options)` does the work and
returns the exit status, or nothing for 0. Its `--help` prints the module's docstring below the first line. Only the
module of the program that is asked for is imported.
"""

import argparse
import errno
import math
import re
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from io import TextIOWrapper
from typing import Any, NoReturn

from kinespace.tools.cli.entry import check_interrupted
from kinespace.tools.cli.values import meant, printable

#: Module, below `kinespace.tools`, and line of help of each program, by name.
Programs = Mapping[str, tuple[str, str]]

#: `evaluate` has no module: its experiments are programs.
PROGRAMS: Programs = {
    "demo": ("programs.demo", "play motions into a recogniser on this machine, with the built-in library alone"),
    "live": ("programs.live", "recognise a feed"),
    "camera": ("programs.camera", "find bodies in a camera's or a film's pictures, and send their joints"),
    "replay": ("programs.replay", "send recordings, or the built-in library's motions, as a fake live feed"),
    "page": ("programs.page", "show a recogniser's bodies and answers in the browser, and teach from there"),
    "record": ("programs.record", "keep a feed's packets as they come, to replay them"),
    "convert": ("programs.convert", "write recordings as plain numbers"),
    "latency": ("programs.latency", "measure the time from frame to answer, and of a bare echo"),
    "cut": ("programs.cut", "propose labels for a recording: a row for each movement"),
    "build": ("programs.build", "make a motion library from recordings and other libraries"),
    "learn": ("evaluation.learn", "teach a library which movement is unknown, with takes of strangers"),
    "info": ("programs.info", "describe a motion library or recordings"),
    "evaluate": ("", "measure how often the right class is found"),
    "bench": ("programs.bench", "measure the cost of every step"),
    "keys": ("programs.keys", "make keys, so that only known programs connect by ZeroMQ"),
    "feeds": ("programs.feeds", "list the products whose feeds kinespace understands, and their settings"),
    "examples": ("programs.examples", "list programs and tables of joint names to copy, or print one"),
    "listen": ("programs.listen", "show the packets on a port, guess the feed, name the missing joints"),
}
#: Characters that say why a program failed, or for each of several files why, at most.
_MAX_SAID = 280
#: The experiments of `kinespace evaluate`.
EXPERIMENTS: Programs = {
    "retrieval": ("evaluation.evaluate_retrieval", "the paper's experiment: nearest neighbours in three spaces"),
    "stream": ("evaluation.evaluate_stream", "play takes through the live recogniser"),
    "faults": ("evaluation.evaluate_faults", "play takes with joints frozen, lost or exchanged, and bodies that jump"),
    "teach": ("evaluation.evaluate_teach", "teach a few examples of one person, and ask further motions"),
    "gestures": ("evaluation.evaluate_gestures", "teach a gesture by one example, and count words in long takes"),
    "show": ("evaluation.evaluate_show", "teach gestures, and count words in everyday movement between them"),
    "peers": ("evaluation.evaluate_peers", "name whole motions beside what a researcher would otherwise take"),
    "progress": ("evaluation.evaluate_progress", "measure the errors of phase and speed"),
    "done": ("evaluation.evaluate_done", "play takes, and count the motions that were done and the false alarms"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `kinespace`; return the exit status: 0 done, 1 ended by the user or not answered, 2 failed."""
    for stream in (sys.stdout, sys.stderr):
        # A performer's name with characters that this terminal lacks must not end a recogniser.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        options = _parser().parse_args(arguments)
        from kinespace.library import memory  # noqa: PLC0415 - numpy comes with it, and `--version` needs none

        with memory.limited_to(options.max_memory or memory.MAX_MEMORY):
            status: int = options.run(options) or 0
    except KeyboardInterrupt:
        return 1
    except RuntimeError:
        # Python 3.11 wraps an interrupt that comes while a class is made, as on import.
        check_interrupted()
        raise
    except BrokenPipeError:
        # The reader of our output has closed it: print nothing more, not even at the interpreter's end.
        sys.stderr.close()
        return 1
    except (OSError, ValueError, ImportError, MemoryError) as error:
        # numpy calls an interrupt while it is loaded an ImportError.
        check_interrupted()
        print(f"kinespace: {_one_line(error)}", file=sys.stderr)
        return 2
    return status


def _one_line(error: Exception) -> str:
    said = str(error)
    if isinstance(error, OSError) and error.strerror:
        why = "no such file or folder" if error.errno == errno.ENOENT else error.strerror
        said = f"{error.filename}: {why}" if error.filename else why
    several = isinstance(error, ValueError) and not isinstance(error, UnicodeError)
    lines = [printable(" ".join(str(each).split())) for each in (error.args if several else (said,))]
    # A file's own words, or its name, may be of any length: both ends say the most.
    short = (line if len(line) <= _MAX_SAID else f"{line[: _MAX_SAID - 105]} ... {line[-100:]}" for line in lines)
    return "; ".join(short) or type(error).__name__


def _size(text: str) -> int:
    """Read a number of bytes as a person types it: a positive number, perhaps followed by kB, MB or GB."""
    units = {"kb": 1e3, "mb": 1e6, "gb": 1e9}
    unit = text[-2:].lower()
    size = float(text[:-2] if unit in units else text) * units.get(unit, 1.0)
    if not 1 <= size < math.inf:
        raise ValueError(f"size: expected a positive number, got {text}")
    return round(size)


class _Parser(argparse.ArgumentParser):
    """A parser that imports its program when it parses, and says a mistake in one line, with what was perhaps meant.

    Attributes
    ----------
    module
        The program's module, below `kinespace.tools`; empty when the parser has its arguments.
    """

    module = ""

    def error(self, message: str) -> NoReturn:
        """End with status 2 and the mistake."""
        if choice := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message):
            message += meant(choice[1], re.findall(r"[^\s',]+", choice[2]))
        message = message.replace("invalid int value:", "expected a whole number, got")
        line = f"{self.prog}: error: {message}; {self.prog} --help lists all options"
        self.exit(2, f"{printable(line)}\n")

    def parse_known_args(self, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401 - argparse's own has four overloads
        """Parse as argparse does, once the program has said its arguments, and refuse the first that is unknown."""
        self.fill()
        parsed, unknown = super().parse_known_args(*arguments, **options)
        if unknown:
            name = unknown[0].partition("=")[0]
            self.error(f"unknown argument {name}{meant(name, self._option_string_actions)}")
        return parsed, unknown

    def fill(self) -> None:
        """Let the program say which arguments it takes."""
        if self.module:
            program = import_module(f"kinespace.tools.{self.module}")
            self.module = ""
            self.description = (program.__doc__ or "").partition("\n\n")[2]
            program.add_arguments(self)
            self.set_defaults(run=program.run)


class _Version(argparse.Action):
    """Prints the version, which takes 30 ms to find, only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print it and end."""
        print(f"kinespace {import_module('kinespace').__version__}")
        parser.exit()


def whole_parser() -> argparse.ArgumentParser:
    """Make the parser with the arguments of all programs: shtab makes the completion for a shell of it."""
    return _parser(filled=True)


def _parser(*, filled: bool = False) -> _Parser:
    text = "Names the movement a performer is doing, live, from joint positions arriving by OSC or ZeroMQ."
    parser = _Parser(prog="kinespace", description=text)
    parser.add_argument("--version", action=_Version, nargs=0, help="show the program's version number and exit")
    text = "memory that one file may take when it is read, like 500MB or 4GB (default 1GB)"
    parser.add_argument("--max-memory", type=_size, metavar="SIZE", help=text)
    programs = _add_programs(parser, PROGRAMS, title="programs", metavar="PROGRAM")
    experiments = _add_programs(programs["evaluate"], EXPERIMENTS, title="experiments", metavar="EXPERIMENT")
    if filled:
        for each in (*programs.values(), *experiments.values()):
            each.fill()
    return parser


def _add_programs(parser: _Parser, programs: Programs, *, title: str, metavar: str) -> dict[str, _Parser]:
    """Add the programs to a parser; return the parser of each."""
    added = parser.add_subparsers(title=title, metavar=metavar, required=True)
    parsers = {name: added.add_parser(name, help=text) for name, (_, text) in programs.items()}
    for name, each in parsers.items():
        each.module = programs[name][0]
    return parsers
