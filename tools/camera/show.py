"""The camera's pictures with the skeletons in them, for a browser on this machine (`--show`); nothing is stored.

One page with one picture that keeps changing: HTTP's `multipart/x-mixed-replace`. The path is a secret, so that no page
of another site, which may ask this machine too, ever shows a picture.
"""

from __future__ import annotations

import ipaddress
import secrets
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Self

from kinespace.tools.cli.values import host_and_port

#: Seconds after which a browser gets the last picture again: so one that has left is noticed.
_AGAIN = 1.0
_PAGE = b'<!doctype html><html lang="en"><title>kinespace camera</title><style>body{margin:0;background:#111}\
p{position:fixed;margin:8px;color:#fff;font:13px sans-serif;text-shadow:0 0 3px #000}\
img{width:100vw;height:100vh;object-fit:contain}</style><p>These pictures stay on this machine. Nothing is stored.</p>\
<img src="picture" alt="The camera\'s picture"></html>'
_HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; img-src 'self'; style-src 'unsafe-inline'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Show:
    """Serves pictures until it is left; a context manager.

    Parameters
    ----------
    address
        [HOST:]PORT on this machine; port 0 takes a free one.

    Attributes
    ----------
    address
        The page's address, with its secret.

    Raises
    ------
    OSError
        The address is taken, or impossible.
    ValueError
        It is no address, or other machines could reach it.
    """

    def __init__(self, address: str) -> None:
        host, port = host_and_port(address)
        if not ipaddress.ip_address("127.0.0.1" if host == "localhost" else host).is_loopback:
            raise ValueError(f"--show: expected an address of this machine alone, like 127.0.0.1:8011, got {address}")
        self._picture, self._number, self._ended = b"", 0, False
        self._news = threading.Condition()
        secret = f"/{secrets.token_urlsafe(16)}/"

        try:
            self._server = ThreadingHTTPServer((host, port), partial(_Handler, secret, self))
        except OSError as error:
            raise OSError(error.errno, f"{address}: {error.strerror}") from error
        self._server.daemon_threads = True
        self.address = f"http://{host}:{self._server.server_address[1]}{secret}"
        self.watchers = 0

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, name="kinespace show", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._news:
            self._ended = True
            self._news.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def put(self, draw: Callable[[], bytes]) -> None:
        """Show another picture, which is drawn only if somebody looks."""
        if self.watchers:
            picture = draw()
            with self._news:
                self._picture, self._number = picture, self._number + 1
                self._news.notify_all()

    def after(self, number: int) -> tuple[bytes, int] | None:
        """Wait for a newer picture than the one of this number, and not too long; None at the end."""
        with self._news:
            self._news.wait_for(lambda: self._ended or self._number > number, _AGAIN)
            return None if self._ended else (self._picture, self._number)


class _Handler(BaseHTTPRequestHandler):
    """Answers one browser."""

    def __init__(self, place: str, pictures: Show, *request: Any) -> None:  # noqa: ANN401 - the library's own
        self.place, self.pictures = place, pictures
        super().__init__(*request)

    def do_GET(self) -> None:
        """Give the page, or the picture without end."""
        if self.path not in (self.place, f"{self.place}picture"):
            self.send_error(404)
        elif self.path == self.place:
            self._begin("text/html; charset=utf-8")
            self.wfile.write(_PAGE)
        else:
            self._begin("multipart/x-mixed-replace; boundary=next")
            self.pictures.watchers += 1
            try:
                with suppress(OSError):
                    self._stream()
            finally:
                self.pictures.watchers -= 1

    def _begin(self, kind: str) -> None:
        self.send_response(200)
        for name, value in {"Content-Type": kind, **_HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()

    def _stream(self) -> None:
        number = 0
        while news := self.pictures.after(number):
            picture, number = news
            if picture:
                self.wfile.write(b"--next\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(picture))
                self.wfile.write(picture + b"\r\n")

    def log_message(self, *_: Any) -> None:  # noqa: ANN401 - the library's own
        """Say nothing."""
