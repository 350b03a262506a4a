"""`kinespace listen`: shows the packets on a port, the feed they look like, and the joints that recognition lacks.

Try this first when nothing works. It shows every kind of message that arrives, with types, rate, senders and gaps; the
feed that the messages resemble; the joints that came, and the joints that recognition lacks.
"""

import argparse
import shlex
from collections.abc import Sequence
from contextlib import closing, suppress

from kinespace.library import MotionLibrary
from kinespace.library.motion_library import MIN_JOINTS
from kinespace.library.naming import Naming, hdm05, summary, unknown_names
from kinespace.library.recordings.formats.table_header import coordinate_of
from kinespace.stream.feeds import Preset, builtin_names, builtin_preset
from kinespace.stream.inputs import FeedSource, OwnDecoder, Source
from kinespace.stream.inputs.detection import MAX_KINDS, NATIVE, OURS, Guess, Survey
from kinespace.stream.inputs.source import taking
from kinespace.stream.osc import OscReceiver
from kinespace.stream.osc.messages import SKELETON
from kinespace.tools.cli.arguments import OSC_IN, add_shared, positive, preset_named
from kinespace.tools.cli.console import console, print_json, say, table_of
from kinespace.tools.cli.values import host_and_port, opening

#: Kinds of messages that are shown, at most.
_MAX_SHOWN = 40
#: Joints that wait for a coordinate, and that are named, at most.
_MAX_NAMED = 3
#: Seconds of a gap that is reported, at least.
_GAP_SECONDS = 0.2
#: Intervals of the message's own rate in a gap that is reported, at least.
_GAP_INTERVALS = 4.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the program's options."""
    parser.add_argument("port", nargs="?", metavar="[HOST:]PORT", help=f"default: the feed's port, else {OSC_IN}")
    parser.add_argument("--feed", metavar="NAME", help="read the packets as this feed, and ask its sender for frames")
    parser.add_argument("--seconds", type=positive, default=5.0, help="seconds to listen (default %(default)s)")
    add_shared(parser, "--sender", "--json")


def run(options: argparse.Namespace) -> int:
    """Listen for some seconds and report: 0 when the feed can be recognised, 1 when not."""
    feed, address = options.feed, options.port or (None if options.feed else OSC_IN)
    preset = preset_named(feed) if feed else None
    host, port = host_and_port(address) if address else ("127.0.0.1", preset.port if preset else 0)
    with opening("listen"):
        receiver = OscReceiver(host, port)
    place = host, port = receiver.address
    if not options.json:
        say(f"listening on OSC {host}:{port} for {options.seconds:g} s; Ctrl-C ends")
    survey = surveyed(receiver, options.seconds, preset, options.sender)
    presets = [preset] if preset else [builtin_preset(name) for name in builtin_names()]
    guess = survey.looked_at_as(preset) if preset else survey.guess(presets)
    lines = advice(survey, guess, address)
    pasted = command(guess, feed, place) if guess and guess.frames else None
    if options.json:
        print_json(as_object(survey, guess, lines) | {"command": pasted})
    else:
        _show(survey, guess, [*([f"recognise it: {pasted}"] if pasted else []), *lines])
    return 0 if guess and guess.frames else 1


def surveyed(receiver: OscReceiver, seconds: float, preset: Preset | None, sender: str) -> Survey:
    """Collect packets for some seconds, or until Ctrl-C; send the preset's messages to the sender if it has any."""
    survey = Survey()
    source = FeedSource(receiver, preset, sender=sender) if preset else Source(receiver, OwnDecoder())
    source.recorder = survey
    with closing(source), suppress(KeyboardInterrupt):
        for _ in taking([source], seconds):
            pass
    return survey


def advice(survey: Survey, guess: Guess | None, address: str | None) -> list[str]:
    """List the faults of the feed with their remedies; empty when all is well."""
    lines = list[str]()
    if not survey.packets:
        lines.append("nothing arrived: does the sender send to this port and to this machine's address?")
        if not (address or "").startswith("0.0.0.0"):  # noqa: S104 - compared, not bound
            lines.append("for the packets of another machine listen on 0.0.0.0:PORT, and let the firewall pass them")
        return lines
    if survey.undecodable:
        lines.append(f"{survey.undecodable} of {survey.packets} packets are no OSC: another protocol on this port?")
    addresses = [kind.address for kind in survey.kinds.values()]
    if guess is None and not {*addresses}.isdisjoint(OURS):
        return [*lines, *survey.looked_at_as(builtin_preset(NATIVE)).refusals]
    if waiting := _waiting(addresses):
        lines.append(f"{', '.join(waiting)}: the sender sends only what changes; let it send all once, or always")
    elif guess is None:
        nearest = "touchdesigner" if any(each.endswith((":tx", ":ty", ":tz")) for each in addresses) else "native"
        begun = f"kinespace feeds {nearest} > my.toml begins a preset"
        lines.append(f"no known feed: kinespace listen shows the messages (end this first); {begun}")
    if guess is None:
        return lines
    lines += [*_lacking(survey, guess), *_odd(guess)]
    if set(guess.preset.sent).isdisjoint(MotionLibrary.builtin().skeleton.joints):
        lines.append("none of the joints is the built-in library's: build your own library from this feed")
    lines += [
        f"{kind.address}: nothing for {kind.longest_gap:.2f} s once"
        for kind in survey.kinds.values()
        if kind.rate > 1 and kind.longest_gap > max(_GAP_SECONDS, _GAP_INTERVALS / kind.rate)
    ][:3]
    return lines


def _waiting(addresses: Sequence[str]) -> list[str]:
    """Name some joints of which one or two coordinates came in messages of their own, and those that never did."""
    came = dict[str, set[str]]()
    for joint, axis in filter(None, map(coordinate_of, addresses)):
        came.setdefault(joint, set()).add(axis)
    waits = {joint: " and ".join(sorted({*"xyz"} - axes)) for joint, axes in came.items()}
    return [f"{joint} waits for {axes}" for joint, axes in waits.items() if axes][:_MAX_NAMED]


def _lacking(survey: Survey, guess: Guess) -> list[str]:
    """List the joints and frames that recognition lacks."""
    if guess.preset.name == NATIVE and survey.announced:
        return _named_otherwise(survey)
    if guess.missing and guess.preset.name == NATIVE and not any(k.address == SKELETON for k in survey.kinds.values()):
        unnamed = f"{len(guess.joints)} joints whose names were never sent: let the sender send {SKELETON}"
        return [f"{unnamed}, or say which they are: kinespace live --joints {_listing(len(guess.joints))}"]
    lines = list[str]()
    if guess.missing and guess.frames:
        lines.append(f"not used, because they never came: {', '.join(guess.missing)}")
    elif guess.missing:
        lines.append(f"missing for recognition: {', '.join(guess.missing)}")
        lines.append("let the sender send them, or leave them out of [joints] in a copy of the preset")
    if guess.at_rest:
        lines.append(f"bones that never came, and stay at rest: {', '.join(guess.at_rest)}")
    if guess.unknown:
        lines.append(f"joints sent that the preset does not name: {', '.join(guess.unknown[:12])}")
    if guess.preset.closings.some and len(guess.joints) < MIN_JOINTS:
        lines.append(f"joints whose names are known: {len(guess.joints)}, and {MIN_JOINTS} are needed at least")
    elif not guess.frames and not guess.missing:
        lines.append("no whole frame: the time was too short, or the joints come too far apart")
    elif guess.refused:
        lines.append(f"{guess.refused} frames refused, because too many joints were absent from them")
    return lines


def _listing(count: int) -> str:
    """Name the presets that list this number of joints, in the order of frames; the first as an option takes it."""
    known = {name: builtin_preset(name) for name in builtin_names() if name != NATIVE}
    first, *others = [name for name, preset in known.items() if len(preset.order) == count] or ["A,B,..."]
    return f"{first} (or {', '.join(others)})" if others else first


def _odd(guess: Guess) -> list[str]:
    """Describe oddities of the frames, and the reasons why packets could not be read."""
    return [
        *(f"performer {name}: {line}" for name, each in guess.heard.items() if guess.frames for line in each.remarks()),
        *guess.refusals,
    ]


def command(guess: Guess, feed: str | None, place: tuple[str, int]) -> str:
    """Give the command that recognises the feed on a host and port; `feed` as typed, if it was."""
    native = guess.preset.name == NATIVE
    named = "" if native else f" --feed {shlex.quote(feed or guess.preset.name)}"
    usual = OSC_IN if native else f"127.0.0.1:{guess.preset.port}"
    host, port = place
    return f"kinespace live{named}" + ("" if f"{host}:{port}" == usual else f" --osc-in {host}:{port}")


def _named_otherwise(survey: Survey) -> list[str]:
    """Report announced joints of which fewer than five have known names."""
    shared = set(Naming().read(survey.announced).joints) & set(hdm05.SKELETON.joints)
    if len(shared) >= MIN_JOINTS:
        return []
    unknown = unknown_names(survey.announced, hdm05.SKELETON.joints)
    return [f"{len(shared)} of the {len(survey.announced)} announced joints have known names; {unknown}"]


def as_object(survey: Survey, guess: Guess | None, lines: list[str]) -> dict[str, object]:
    """Put everything that was found into one object for JSON."""
    counted = {name: getattr(survey, name) for name in ("packets", "undecodable", "bundles", "largest", "senders")}
    return counted | {
        "messages": [
            {"address": kind.address, "types": kind.types, "count": kind.count, "rate": round(kind.rate, 3)}
            for kind in survey.kinds.values()
        ],
        "feed": guess.preset.name if guess else None,
        "frames": guess.frames if guess else 0,
        "rate": round(guess.rate, 3) if guess else 0.0,
        "performers": guess.performers if guess else [],
        "joints": list(guess.joints) if guess else [],
        "missing": list(guess.missing) if guess else [],
        "names": Naming().read(survey.announced).title if survey.announced else None,
        "advice": lines,
    }


def _show(survey: Survey, guess: Guess | None, lines: list[str]) -> None:
    shown, rows = sorted(survey.kinds.values(), key=lambda kind: -kind.count), list[tuple[str, ...]]()
    for kind in shown[:_MAX_SHOWN]:
        example = " ".join(f"{each:.3g}" if isinstance(each, float) else str(each) for each in kind.example)
        figures = (str(kind.count), f"{kind.rate:.1f}", f"{kind.longest_gap:.2f} s")
        rows.append((kind.address, kind.types, example, *figures))
    if survey.kinds:
        headings = ("address", "types", "for example", "messages", "per second", "longest gap")
        console.print(table_of("kinespace listen", headings, rows, caption=_caption(survey), names=3))
    if len(shown) > _MAX_SHOWN:
        console.print(f"and {len(shown) - _MAX_SHOWN}{' or more' if len(shown) >= MAX_KINDS else ''} other kinds")
    if guess:
        preset, understood = guess.preset, f"{guess.understood:.0%} of the messages"
        joints = f"{len(guess.joints)} of {len(preset.sent)} joints, {guess.frames} frames"
        say(f"looks like {preset.name} ({preset.product}): {understood}, {joints}")
        if survey.announced:
            named = Naming().read(survey.announced)
            say(summary(named.title or "our", named.joints))
        if guess.frames:
            say(f"performers: {', '.join(guess.performers)}, {guess.rate:.1f} frames per second each")
    for line in lines:
        say(line)


def _caption(survey: Survey) -> str:
    senders = ", ".join(f"{name} ({count})" for name, count in list(survey.senders.items())[:4])
    return f"{survey.packets} packets, {survey.bundles} bundles, largest {survey.largest} bytes, from {senders}"
