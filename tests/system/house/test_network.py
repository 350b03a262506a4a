"""No test asks a network, nor does a program that a test starts."""

import subprocess
import sys

from programs import LOOPBACK

#: Addresses that are on no machine (RFC 5737, RFC 3849), and a name that nobody has (RFC 6761).
FAR, FAR6, NAME = "192.0.2.77", "2001:db8::1", "stage.invalid"

_TRIED = f"""
import socket
def refused(act):
    try:
        act()
    except OSError as error:
        return "tests ask no network" in str(error)
    return False
udp, udp6 = socket.socket(type=socket.SOCK_DGRAM), socket.socket(socket.AF_INET6, socket.SOCK_DGRAM)
found = [
    refused(lambda: socket.create_connection(({FAR!r}, 9))),
    refused(lambda: udp.sendto(b"", ({FAR!r}, 9))),
    refused(lambda: udp.sendto(b"", ("224.0.0.251", 5353))),
    refused(lambda: udp.sendto(b"", ("255.255.255.255", 9))),
    refused(lambda: udp.connect(({NAME!r}, 9))),
    refused(lambda: udp6.sendto(b"", ({FAR6!r}, 9))),
    refused(lambda: udp6.sendto(b"", ("ff02::fb", 5353))),
    refused(lambda: socket.getaddrinfo({NAME!r}, 9)),
    refused(lambda: socket.gethostbyname({NAME!r})),
]
udp.sendto(b"", ({LOOPBACK!r}, 9))
udp6.sendto(b"", ("::1", 9))
udp.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton({LOOPBACK!r}))
udp.sendto(b"", ("224.0.0.251", 5353))
socket.getaddrinfo("localhost", 9)
udp.close()
udp6.close()
"""


def test_this_process_asks_no_network() -> None:
    """Connections, datagrams, multicast and look-ups of names are refused, but those that stay on this machine."""
    names: dict[str, list[bool]] = {}
    exec(_TRIED, names)  # noqa: S102 - the same as in a program
    assert names["found"] == [True] * 9


def test_a_program_asks_no_network() -> None:
    """The programs that tests start refuse the same."""
    command = [sys.executable, "-c", f"{_TRIED}\nprint(found)"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str([True] * 9)
