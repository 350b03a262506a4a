"""Arguments that several programs share: groups of options; numbers, names, presets and joints in the command line."""

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from kinespace.library import Clip, MotionLibrary
from kinespace.library.naming import AS_THEY_ARE, AUTO, ConventionError, Naming, conventions, spelling
from kinespace.library.recordings import FILMS, ActorIn, Reading
from kinespace.stream import LiveSignature, Settings
from kinespace.stream.feeds import Preset, builtin_names, builtin_preset, load_preset
from kinespace.stream.recognizer import settings as usually
from kinespace.tools.cli.values import meant, one_of

#: The ending of a user's own preset.
_ENDING = ".toml"


def preset_named(text: str) -> Preset:
    """Load a preset by its name, or from a user's file, which ends in .toml.

    Raises
    ------
    ValueError
        There is none of that name, or something in the file is wrong; the message begins with `--feed` or the file.
    OSError
        The file cannot be read.
    """
    if text.casefold().endswith(_ENDING):
        return load_preset(Path(text))
    return builtin_preset(one_of("--feed", text, builtin_names(), f" or a {_ENDING} file"))


def joints_in_order(text: str) -> tuple[str, ...]:
    """Read the joints of a sender's frames, in order, from an option's text.

    Parameters
    ----------
    text
        Names with commas between; or a preset with an `order`, by its name or a file ending in .toml.

    Returns
    -------
    The motion library's names, and the sender's own names for joints that the library lacks.

    Raises
    ------
    ValueError
        A preset has no order, because its messages name their joints; or a name is empty or appears twice.
    OSError
        The file cannot be read.
    """
    if "," in text:
        joints = tuple(name.strip() for name in text.split(","))
    else:
        ordered = [each for each in builtin_names() if builtin_preset(each).order]
        if text not in builtin_names() and not text.endswith(".toml"):
            one_of("--joints", text, ordered, ", a .toml file or names with commas between")
        preset = preset_named(text)
        if not preset.order:
            known = ", ".join(ordered)
            raise ValueError(f"--joints: expected a preset with an order of joints ({known}), got {text}")
        ours = {spelling(name): target for name, target in preset.joint_map.items()}
        joints = tuple(ours.get(spelling(name)) or name for name in preset.order)
    if not all(joints) or len(set(joints)) != len(joints):
        raise ValueError(f"--joints: expected distinct names with commas between, got {text!r}")
    return joints


def joints_of(name: str) -> tuple[str, ...]:
    """Give the joints of a preset, in HDM05's names.

    Raises
    ------
    ValueError
        There is no such preset.
    """
    return builtin_preset(one_of("--skeleton", name, builtin_names())).joints


_Made = TypeVar("_Made")
_DEFAULTS = Settings()
#: Where frames come in unless the user says otherwise: a port that none of the usual senders uses.
OSC_IN = "127.0.0.1:9310"
#: Where the page is unless the user says otherwise.
PAGE = "127.0.0.1:8010"
#: The name of the built-in library wherever a library may be named.
BUILT_IN = Path("built-in")


def several(kind: Callable[[str], object], metavar: str) -> dict[str, Any]:
    """Give what an option is that takes several words, and may be given again."""
    return {"nargs": "+", "action": "extend", "type": kind, "default": [], "metavar": metavar}


_TAKES = "file,subject,contains,perhaps for each take; a take with both of the last empty shows no known motion"
#: Options that several programs have, by name.
_SHARED: dict[str, dict[str, Any]] = {
    "--osc-in": {"metavar": "[HOST:]PORT", "help": f"listen for OSC here (default {OSC_IN}, unless --zmq-in is given)"},
    "--zmq-in": {"metavar": "ENDPOINT", "help": "subscribe to ZeroMQ, like tcp://127.0.0.1:9320"},
    "--keys": {
        "type": Path,
        "metavar": "DIR",
        "help": "accept by ZeroMQ only those whose .key is there: kinespace keys makes them",
    },
    "--open": {"action": "store_true", "help": "let anybody reach an endpoint bound beyond this machine"},
    "--people": {"type": int, "default": 1, "metavar": "N", "help": "people a camera follows, 4 at most (default 1)"},
    "--size": {"choices": ("full", "lite"), "default": "full", "help": "of the camera's landmark network"},
    "--either-side": {"action": "store_true", "help": "add each example mirrored: a motion may be done by either side"},
    "--sender": {"metavar": "HOST", "default": "127.0.0.1", "help": "host to ask for frames, for feeds that ask"},
    "--feed": {
        "metavar": "NAME",
        "help": "read a .kinerec as this product's packets, see kinespace feeds; or FILE.toml (default: as recorded)",
    },
    "--takes": {**several(Path, "CSV"), "dest": "tables", "help": _TAKES},
    "--subjects": {**several(str, "NAME"), "help": "takes of these persons only"},
    "--library": {"type": Path, "metavar": "FILE", "help": f"a motion library (default: {BUILT_IN})"},
    "--json": {"action": "store_true", "help": "print JSON and nothing else (.github/docs/json.md says what)"},
    "--overwrite": {"action": "store_true", "help": "write over an existing file (default: refuse)"},
    "--actor-in": {
        "choices": [each.value for each in ActorIn],
        "default": ActorIn.NOWHERE.value,
        "help": "place of the actor's name: the file's name up to the first _, or the folder above the class's folder",
    },
}


def add_shared(parser: argparse.ArgumentParser, *options: str) -> None:
    """Add options that several programs have."""
    for option in options:
        parser.add_argument(option, **_SHARED[option])


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options for reading recordings."""
    parser.add_argument("--asf", type=Path, help="skeleton of AMC files (default: found by name)")
    parser.add_argument("--frame-rate", type=positive, metavar="HZ", help="of all recordings (default: their own)")
    text = "of the recordings: m, cm, mm, in, ft or metres (default: the file's own, or by size)"
    parser.add_argument("--unit", default="", help=text)
    text = "only these joints or markers; * and ? fit any"
    parser.add_argument("--joints", type=names, default=(), metavar="A,B,...", help=text)
    add_names(parser, "files")


def add_names(parser: argparse.ArgumentParser, whose: str) -> None:
    """Add the option for the convention of joint names."""
    known = ", ".join(sorted(each.name for each in conventions()))
    text = f"how the {whose} name joints: {AUTO}, {AS_THEY_ARE}, {known}, or FILE.toml (default %(default)s)"
    parser.add_argument("--names", dest="naming", default=AUTO, metavar="NAME", help=text)


def library_at(path: Path | None) -> MotionLibrary:
    """Load the library of a file, or the built-in one by its name or when there is no path.

    Raises
    ------
    ValueError
        The file is no library.
    OSError
        It cannot be opened.
    """
    return MotionLibrary.builtin() if path in (None, BUILT_IN) else MotionLibrary.load(path)


def class_at(place: Path) -> str:
    """Give the class of the built-in library whose name is typed in place of a file; empty where there is a file.

    Raises
    ------
    ValueError
        There is no file, folder or class of that name.
    """
    if place.exists():
        return ""
    name, classes = str(place), MotionLibrary.builtin().classes
    if name not in classes:
        near = meant(name, classes)
        listed = "" if near or place.suffix else ", nor a class of the built-in library (`kinespace info` lists them)"
        raise ValueError(f"{place}: no such file or folder{near or listed}")
    return name


def made_of(kind: type[_Made], parsed: argparse.Namespace, **further: object) -> _Made:
    """Make a dataclass of the arguments that are called as its fields, and of further ones."""
    given = {each.name: getattr(parsed, each.name) for each in fields(kind) if hasattr(parsed, each.name)}  # type: ignore[arg-type]  # a dataclass
    return kind(**{**given, **further})


def reading_of(parsed: argparse.Namespace) -> Reading:
    """Make the reading options from the arguments."""
    naming, actor_in = naming_of(parsed), ActorIn(getattr(parsed, "actor_in", ActorIn.NOWHERE))
    raw = partial(_raw, feed=getattr(parsed, "feed", None))
    return made_of(Reading, parsed, naming=naming, actor_in=actor_in, raw=raw)


def naming_of(parsed: argparse.Namespace) -> Naming:
    """Read the option for the convention of joint names."""
    text: str = parsed.naming
    try:
        return Naming.asked(text)
    except ConventionError as error:
        if text.endswith(".toml"):
            raise
        known = (AUTO, AS_THEY_ARE, *(each.name for each in conventions()))
        raise ValueError(f"--{error}{meant(text, known)}") from error


def _raw(path: Path, feed: str | None) -> Sequence[Clip]:
    from kinespace.stream.inputs.takes import read_raw  # noqa: PLC0415 - decoders are loaded only for a raw recording

    if path.suffix.lower() in FILMS:
        from kinespace.tools.camera.bodies import film_clip  # noqa: PLC0415 - as above

        return [film_clip(path)]
    return read_raw(path, preset_named(feed) if feed else None)


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the options for the recogniser's settings."""
    signatures, usual = [*map(str, LiveSignature)], str(_DEFAULTS.signature)
    text = "compare all parts of the signature over several windows, or as the paper, centred (default %(default)s)"
    parser.add_argument("--signature", choices=signatures, default=usual, help=text)
    text = (
        "share of unknown motions that may be named, by the library's estimate (default: "
        f"{usually.SENSITIVITY_LEARNED} with the built-in library, {usually.SENSITIVITY_OWN} with yours, "
        f"{usually.SENSITIVITY_ONE} with one motion of each class, {usually.SENSITIVITY_CAMERA} of several before "
        "cameras); windows only"
    )
    parser.add_argument("--sensitivity", type=share, help=text)
    parser.add_argument("--window", type=positive, help="seconds of the paper's window (default 0.5); paper only")
    text = "seconds between answers (default 1/30)"
    parser.add_argument("--hop", type=not_negative, default=_DEFAULTS.hop, help=text)
    text = "say with each answer how far the motion is, how fast, how large; windows only"
    parser.add_argument("--progress", action="store_true", help=text)
    text = (
        "motions an hour that may be said to be done though they were not, like 1/h or 60/h; 0 says none "
        f"(default {_DEFAULTS.false_alarms:g}/h); windows only"
    )
    usual_rate = _DEFAULTS.false_alarms
    parser.add_argument("--false-alarms", type=per_hour, default=usual_rate, metavar="N/h", help=text)
    text = "believe every joint of every frame, also of a body that moves as no body can"
    parser.add_argument("--no-plausibility", dest="plausibility", action="store_false", help=text)


def settings_of(parsed: argparse.Namespace) -> Settings:
    """Make settings from the arguments; `Settings` refuses what does not belong to the signature."""
    # `live --stillness` is of lessons.
    return made_of(Settings, parsed, stillness=_DEFAULTS.stillness)


def _number(expected: str, fits: Callable[[float], bool]) -> Callable[[str], float]:
    """Make a type of argument: a number that fits."""

    def read(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"expected a number, got {text!r}") from None
        if not fits(number):
            raise argparse.ArgumentTypeError(f"expected {expected}, got {text}")
        return number

    return read


positive = _number("a positive number", lambda number: 0 < number < math.inf)
not_negative = _number("a number not below 0", lambda number: 0 <= number < math.inf)
share = _number("a share from 0 to 1", lambda number: 0 <= number <= 1)


def per_hour(text: str) -> float:
    """Read a number of times an hour, like `6/h`."""
    return not_negative(text.removesuffix("/h"))


_whole = _number("a whole number above 0", lambda number: number >= 1 and number.is_integer())


def names(text: str) -> tuple[str, ...]:
    """Read names with commas between."""
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise argparse.ArgumentTypeError(f"expected names with commas between, got {text!r}")
    return names


def count(text: str) -> int:
    """Read a whole number above 0."""
    return int(_whole(text))


def mapping(text: str) -> tuple[str, str]:
    """Read LABEL=CLASS."""
    label, equals, class_name = text.partition("=")
    if not (label and equals and class_name):
        raise argparse.ArgumentTypeError(f"expected LABEL=CLASS, got {text!r}")
    return label, class_name
