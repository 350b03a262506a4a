import re
import threading
import time
import urllib.error
import urllib.request

import pytest

from kinespace.tools.programs.camera.show import Show


def _get(address: str) -> tuple[bytes, dict[str, str]]:
    with urllib.request.urlopen(address, timeout=60) as reply:  # noqa: S310 - our own address
        return reply.read(), dict(reply.headers)


def test_a_page_with_pictures_that_change() -> None:
    """The page has one picture without end; a picture is drawn only while somebody looks."""
    with Show("127.0.0.1:0") as show:
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\S{20,}/", show.address)
        body, headers = _get(show.address)
        assert b'<img src="picture"' in body
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["Cache-Control"] == "no-store"
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        show.put(lambda: pytest.fail("drawn for nobody"))
        with urllib.request.urlopen(f"{show.address}picture", timeout=60) as stream:  # noqa: S310 - as above
            while not show.watchers:
                time.sleep(0.01)
            for picture in (b"first", b"second"):
                threading.Timer(0.05, show.put, [lambda picture=picture: picture]).start()
                assert stream.readline() == b"--next\r\n"
                assert stream.readline() == b"Content-Type: image/jpeg\r\n"
                assert stream.readline() == b"Content-Length: %d\r\n" % len(picture)
                assert stream.readline() == b"\r\n"
                assert stream.read(len(picture) + 2) == picture + b"\r\n"


def test_without_its_secret_nothing_is_shown() -> None:
    """Another site's page, which may ask this machine too, does not know the path."""
    with Show("127.0.0.1:0") as show:
        port = show.address.split(":")[2].partition("/")[0]
        for path in ("", "picture", "x/picture"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                _get(f"http://127.0.0.1:{port}/{path}")
