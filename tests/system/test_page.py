"""The page in a real Chromium: what a person sees and does, from a moving body to a taught motion."""

import contextlib
import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
import pytest
from golden import LAYOUTS, Moment
from numpy.typing import NDArray
from PIL import Image
from programs import LOOPBACK, PATIENCE, ROOT, Program, builtin_library, free_udp_port, motions_of, started

from kinespace.stream import Announcement, Frame
from kinespace.stream.osc import OscSender, encode_announcement, encode_frame
from kinespace.tools.evaluation.evaluate_show import facing

if TYPE_CHECKING:
    # Loaded where there is a Chromium alone: it takes a second.
    from playwright.sync_api import Page

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
#: Set to 1: the pictures of README are taken anew.
PICTURES = "KINESPACE_PICTURES"
#: Bytes of a picture, at most, and its colours.
MAX_PICTURE, COLOURS = 120_000, 256
SQUAT, KICK, ARMS, GRAB = "squat1Reps", "kickLFront1Reps", "rotateArmsBothBackward1Reps", "grabHighR"
#: Frames a second; the motions have 30, and are shown half as fast again, so that nobody waits long.
SENT = 45.0
#: Seconds in which the performer comes to a motion's first posture: no body jumps, and no example begins with a jump.
COMES = 0.4
#: Seconds after which a motion that was not named is shown again.
AGAIN = 12.0
MOTIONS = "kinespace.performers.get('ann').motions.values()"
#: The body as drawn, the motion that goes on, the state of a lesson.
DRAWN, DOING, LESSON = (
    f"document.querySelector('.stage[aria-label=ann] {part}')" for part in ("canvas", ".doing", ".lesson")
)


class Performer:
    """Shows motions in a thread, standing still between them, so that the browser can be asked meanwhile."""

    def __init__(self, port: int) -> None:
        self._sender = OscSender(LOOPBACK, port)
        self._motion = takes(SQUAT)[0]
        self._posture = self._from = self._motion[0]
        self._begun = -1e9
        #: Whether another performer sends too few joints.
        self.bob = False
        #: Whether no frames are sent for now.
        self.away = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._perform)

    def show(self, motion: NDArray[np.float64]) -> None:
        """Begin a motion."""
        root = builtin_library().skeleton.joints.index("root")
        self._from, self._begun = self._posture, time.monotonic()
        self._motion = facing(self._from, motion, root)

    def _perform(self) -> None:
        while not self._ended.wait(1 / SENT):
            # By the clock, because the page tells by its own how long ago a bar was.
            if self.away:
                continue
            moment = time.monotonic()
            since = moment - self._begun
            place = min(max(int((since - COMES) * SENT), 0), len(self._motion) - 1)
            share = min(since / COMES, 1.0)
            self._posture = (1 - share) * self._from + share * self._motion[place]
            self._sender.send(encode_frame(Frame("ann", moment, self._posture)))
            if self.bob:
                self._sender.send(encode_frame(Frame("bob", moment, self._motion[0, :7])))

    def __enter__(self) -> Self:
        self._sender.send(encode_announcement(Announcement("ann", builtin_library().skeleton.joints)))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._sender.close()


def takes(class_name: str) -> list[NDArray[np.float64]]:
    """Give one person's takes of a class."""
    return [each.positions for each in motions_of(class_name)]


@contextmanager
def opened(address: str, complaints: list[str], *further: str) -> Iterator["Page"]:
    """Open an address in Chromium; what the console says is complained of."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - only where there is a Chromium

    # The last three: the browser is to ask for nothing by itself.
    options = ["--no-sandbox", "--disable-quic", "--disable-background-networking", "--disable-component-update"]
    with sync_playwright() as playwright:
        # No test asks a network.
        alone = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost"
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=[alone, *options, *further])
        # Without bypass_csp Playwright's own questions die on the page's policy, which forbids to make code of text.
        context = browser.new_context(
            bypass_csp=True, viewport={"width": 1180, "height": 770}, color_scheme="dark", reduced_motion="reduce"
        )
        page = context.new_page()
        page.set_default_timeout(1000 * PATIENCE)
        page.on("console", lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(address)
        yield page
        browser.close()


@contextmanager
def live(port: int, page: str, file: Path, *further: object) -> Iterator[tuple[Program, str]]:
    """Run a recogniser with its page; give the page's address."""
    ends = ("--osc-in", f"{LOOPBACK}:{port}", "--osc-out", f"{LOOPBACK}:{free_udp_port()}")
    options = ("--teach", file, "--plain", "--progress", *further)
    with started("live", *ends, "--page", page, *options) as program:
        yield program, program.expect(r"page: (http://\S+)")[1]


def for_readme() -> bool:
    """Say whether the pictures of README are to be taken anew."""
    return os.environ.get(PICTURES) == "1"


def picture(page: "Page", name: str, folder: Path) -> None:
    """Take a picture of the page; for README, with fewer colours, if this is asked for."""
    taken = page.screenshot()
    assert len(taken) > 10_000
    (folder / name).write_bytes(taken)
    if for_readme():
        with Image.open(folder / name) as whole:
            whole.convert("RGB").quantize(COLOURS, kmeans=2).save(ROOT / ".github" / name, optimize=True)
        assert (ROOT / ".github" / name).stat().st_size < MAX_PICTURE


def until(page: "Page", condition: str) -> None:
    """Wait until an expression is true in the page; a failure says what the page shows."""
    from playwright.sync_api import TimeoutError as TookTooLong  # noqa: PLC0415 - only where there is a Chromium

    try:
        page.wait_for_function(condition)
    except TookTooLong:
        shown = page.evaluate("[document.body.innerText, JSON.stringify(kinespace.control)]")
        pytest.fail(f"not so after {PATIENCE:g} s: {condition}; the page shows {shown}")


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here; Debian's package of that name has it")
@pytest.mark.timeout(590)
def test_a_person_sees_teaches_and_is_recognised(tmp_path: Path) -> None:
    """One visit, from an empty stage to a taught motion that is recognised, and beyond a restart of the recogniser."""
    from axe_playwright_python.sync_playwright import Axe  # noqa: PLC0415 - as above

    port, complaints = free_udp_port(), list[str]()
    with (
        live(port, "0", tmp_path / "mine.npz") as (program, address),
        Performer(port) as performer,
        opened(address, complaints) as page,
    ):
        sees(page, performer, tmp_path)
        accessible = Axe().run(page)
        assert accessible.violations_count == 0, accessible.generate_report()
        teaches(page, performer)
        assert complaints == [], program.errors
        # The recogniser is started anew on the same address: the page comes back by itself.
        assert program.interrupt() == 0
        until(page, "document.querySelector('#state').className === 'lost'")
        with live(port, address.rstrip("/").rpartition(":")[2], tmp_path / "mine.npz"):
            until(page, "document.querySelector('#state').textContent.startsWith('live')")
            until(page, "kinespace.performers.has('ann')")
    assert all("WebSocket" in each for each in complaints)


def shows(page: "Page", performer: Performer, motion: NDArray[np.float64], condition: str) -> None:
    """Show a motion until something is seen of it, again if a busy machine missed it."""
    from playwright.sync_api import TimeoutError as TookTooLong  # noqa: PLC0415 - only where there is a Chromium

    for _ in range(3):
        performer.show(motion)
        with contextlib.suppress(TookTooLong):
            page.wait_for_function(condition, timeout=1000 * AGAIN)
            return
    until(page, condition)


def sees_motion(page: "Page", performer: Performer, name: str, motion: NDArray[np.float64]) -> None:
    """Show a motion after the last has ended, and see one more bar of its class."""
    until(page, f"{DOING}.textContent === ''")
    count = f"[...{MOTIONS}].filter((each) => each.className === '{name}').length"
    shows(page, performer, motion, f"{count} > {page.evaluate(count)}")


def sees(page: "Page", performer: Performer, folder: Path) -> None:
    """See a body that moves, the class of each motion, in dark and light, a refusal, all of it on a phone."""
    until(page, "kinespace.drawn > 5 && kinespace.performers.get('ann')?.stage.joints")
    before = page.evaluate(f"{DRAWN}.toDataURL()")
    for name in (GRAB, ARMS, KICK, SQUAT) * 3 if for_readme() else (KICK, SQUAT):
        sees_motion(page, performer, name, takes(name)[1])
    assert page.evaluate(f"{DRAWN}.toDataURL()") != before
    # A body that stands still carries nothing.
    carried = r"/carried by [a-z ]+ \d+ %/.test(document.querySelector('.stage .carried').textContent)"
    shows(page, performer, takes(SQUAT)[1], carried)
    assert " 0" not in page.inner_text("#counters")
    assert "squat" in page.inner_text("#classes").split()
    picture(page, "page-dark.png", folder)
    until(page, "Object.keys(kinespace.motions).length === 11 && !document.querySelector('#classes canvas').hidden")
    small = "document.querySelector('#classes canvas').toDataURL()"
    still = page.evaluate(small)
    # To people who want no movement a class shows one posture.
    before = page.evaluate("kinespace.played")
    until(page, f"kinespace.drawn > {page.evaluate('kinespace.drawn') + 10}")
    assert (page.evaluate(small), page.evaluate("kinespace.played")) == (still, before)
    page.emulate_media(reduced_motion="no-preference")
    until(page, f"{small} !== {still!r}")
    page.emulate_media(reduced_motion="reduce")
    performer.away = True
    until(page, "document.querySelector('.stage.silent .moment')?.textContent.startsWith('no frames for')")
    until(page, "!kinespace.performers.has('ann')")
    performer.away = False
    until(page, "kinespace.performers.get('ann')?.stage.joints")
    page.click("#theme")
    if for_readme():
        sees_motion(page, performer, KICK, takes(KICK)[2])
    picture(page, "page-light.png", folder)
    performer.bob = True
    until(page, "document.querySelector('#notes').textContent.includes('bob: frames refused')")
    performer.bob = False
    page.set_viewport_size({"width": 390, "height": 844})
    until(page, "document.querySelector('.stage canvas').width < 800")
    # A note may hold another product's address.
    append = "document.querySelector('#notes li').append('_address'.repeat(20))"
    width = page.evaluate(f"() => {{ {append}; return document.documentElement.scrollWidth; }}")
    assert width <= 390
    page.set_viewport_size({"width": 1180, "height": 770})


def teaches(page: "Page", performer: Performer) -> None:
    """Switch a class off, teach its motion by another name, see it recognised, and say that a bar was wrong."""
    # A lesson begins standing: else the way from the kick's last posture to the squat would be part of the example.
    performer.show(takes(SQUAT)[0][:1])
    page.click("#classes button:has-text('squat')")
    page.uncheck("#enabled")
    page.click("#class button:has-text('Close')")
    until(page, f"kinespace.control.off.includes('{SQUAT}')")
    # Chromium closes a dialog some milliseconds after the click, and gives the keyboard back then.
    until(page, "document.activeElement.textContent.startsWith('squat')")
    page.keyboard.press("t")
    page.keyboard.type("my squat")
    page.keyboard.press("Enter")
    until(page, f"{LESSON}.textContent === 'move now'")
    # A bar fills with the movement, in place of figures and of commands that a stage does not have.
    until(page, "getComputedStyle(document.querySelector('.stage .lesson i')).getPropertyValue('--share') >= 0")
    performer.show(takes(SQUAT)[0])
    until(page, "kinespace.control.taught['my squat'] === 1 && document.querySelector('#name').value === ''")
    assert page.evaluate(f"{LESSON}.textContent") == ""
    moves_at_will(page, performer)
    # Another example, by the button of the class and by the key.
    for again in (lambda: page.click("[aria-label='another example of my squat']"), lambda: page.keyboard.press("a")):
        again()
        until(page, f"/^[123]$/.test({LESSON}.textContent)")
        page.click("#teach button:has-text('Cancel')")
        until(page, f"{LESSON}.textContent === ''")
        page.evaluate("document.activeElement.blur()")
    until_taught(page, "kinespace.control.taught['my squat'] === 2", lambda: confirms_a_squat(page, performer))
    until(page, "kinespace.motions['my squat']?.frames.length > 5")
    until_taught(page, "kinespace.control.taught.nothing === 1", lambda: calls_a_kick_nothing(page, performer))
    until(page, "[...kinespace.performers.get('ann').motions.values()].some((each) => each.mark === 'wrong')")
    page.click("#teach button:has-text('Undo')")
    until(page, "!('nothing' in kinespace.control.taught)")
    until_taught(page, "kinespace.control.taught['my kick'] === 1", lambda: teaches_the_past(page, performer))
    until(page, "span === null")
    until(page, f"[...{MOTIONS}].some((each) => each.className === 'my kick' && each.mark === 'taught')")
    # A refusal is told in words, for some seconds.
    page.click("#teach button:has-text('Stop')")
    until(page, "document.querySelector('#said').textContent.startsWith('refused')")
    until(page, "document.querySelector('#said').textContent === ''")


def until_taught(page: "Page", taught: str, show: Callable[[], None]) -> None:
    """Show an example until it is taken: a busy machine loses frames, or names a motion for a moment alone."""
    for _ in range(6):
        until(page, "document.querySelector('#said').textContent === ''")
        show()
        until(page, f"{taught} || document.querySelector('#said').textContent.startsWith('refused')")
        if page.evaluate(taught):
            break
    until(page, taught)


def confirms_a_squat(page: "Page", performer: Performer) -> None:
    """See a squat and say that it was right."""
    sees_motion(page, performer, "my squat", takes(SQUAT)[2])
    until(page, "document.querySelector('#last').textContent === 'was my squat right?'")
    page.click("#teach button:has-text('Right')")


def sees_a_kick(page: "Page", performer: Performer) -> None:
    """See a whole kick."""
    sees_motion(page, performer, KICK, takes(KICK)[2])
    until(page, f"{DOING}.textContent === ''")


def calls_a_kick_nothing(page: "Page", performer: Performer) -> None:
    """See a kick and say that it was nothing."""
    sees_a_kick(page, performer)
    page.click("#motions button:has-text('kick') >> nth=-1")
    page.select_option("#meant", "nothing")
    page.click("#wrong button.main")


def moves_at_will(page: "Page", performer: Performer) -> None:
    """Take the lesson of nothing that is offered after the first gesture, until there is an example."""
    page.click("#at-will")
    until(page, f"{LESSON}.textContent.startsWith('move as you will')")
    performer.show(takes(KICK)[2])
    assert page.evaluate("document.querySelector('#at-will').hidden") is False
    page.wait_for_timeout(1000)
    page.click("#teach button:has-text('Stop')")
    until(page, "kinespace.control.taught.nothing === 1 && !document.querySelector('#at-will.main')")
    page.click("#teach button:has-text('Undo')")
    until(page, "!('nothing' in kinespace.control.taught) && document.querySelector('#at-will.main')")


def teaches_the_past(page: "Page", performer: Performer) -> None:
    """See a kick, drag over it on the timeline, and name it."""
    sees_a_kick(page, performer)
    drags_over_the_last_kick(page)
    page.keyboard.type("my kick")
    page.keyboard.press("Enter")


def drags_over_the_last_kick(page: "Page") -> None:
    """Choose the span of the last kick, so that its name can be typed."""
    box = page.locator("#timeline").bounding_box()
    from_x, to_x = page.evaluate(
        "[LAST.begin - 0.7, LAST.end].map((at) => SCALE.left + (at - nowThere() + SHOWN) / SCALE.seconds)".replace(
            "LAST", f"[...{MOTIONS}].findLast((each) => each.className === '{KICK}' && each.end !== null)"
        ).replace("SCALE", "scaleOf(timeline)")
    )
    page.mouse.move(box["x"] + from_x, box["y"] + 12)
    page.mouse.down()
    page.mouse.move(box["x"] + to_x, box["y"] + 12, steps=4)
    page.mouse.up()
    until(page, "document.activeElement.id === 'span-name' && span.performer === 'ann'")
    assert not page.is_visible("#wrong")
    assert 0.5 < page.evaluate("span.end - span.begin") < 15


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here; Debian's package of that name has it")
def test_an_empty_page_says_where_it_listens_and_what_pours_in(tmp_path: Path) -> None:
    """The address stands in the middle, and below it the product whose packets came and the command that reads them."""
    port, complaints = free_udp_port(), list[str]()
    with live(port, "0", tmp_path / "mine.npz") as (_, address), opened(address, complaints) as page:
        until(page, f"document.querySelector('#empty').textContent.includes('OSC 127.0.0.1:{port}')")
        # A class may have any name, and those of JavaScript's objects are not taught for that.
        until(page, "kinespace.control && !('constructor' in kinespace.control.taught)")
        places = dict(zip(builtin_library().skeleton.joints, takes(SQUAT)[0][0], strict=True))
        with contextlib.closing(OscSender(LOOPBACK, port)) as sender:
            moments = [LAYOUTS["vmc"][1](Moment(places, 1 + number / 30, number)) for number in range(60)]
            for packets in moments:
                for packet in packets:
                    sender.send(packet)
                time.sleep(1 / 30)
        until(page, f"document.querySelector('#why').innerText.includes('--feed vmc --osc-in 127.0.0.1:{port}')")
        sent = sum(map(len, moments))
        until(page, f"document.querySelector('#counters').innerText.includes('received {sent},')")
        assert complaints == []
