"""A bare echo, to measure the cost of everything around a recogniser: it sends every packet back unread."""

import gc
import sys

import zmq

from kinespace.stream import osc, zeromq

LOOPBACK = "127.0.0.1"
ANY = f"tcp://{LOOPBACK}:*"


def main(port: int) -> None:
    """Send packets back until killed: by OSC to a port of this machine, or by ZeroMQ where it is 0.

    It prints its addresses as `kinespace live` does.
    """
    receiver: osc.OscReceiver | zeromq.ZmqReceiver
    sender: osc.OscSender | zeromq.ZmqSender
    if port:
        receiver, sender = osc.OscReceiver(LOOPBACK, 0), osc.OscSender(LOOPBACK, port)
        addresses = f"{LOOPBACK}:{receiver.address[1]}", f"{LOOPBACK}:{port}"
    else:
        endpoint = zeromq.Endpoint(ANY, bind=True)
        receiver, sender = zeromq.ZmqReceiver(endpoint), zeromq.ZmqSender(endpoint)
        addresses = receiver.address, sender.address
    print("listening on echo {}; answering to echo {};".format(*addresses), flush=True)
    poller = zmq.Poller()
    poller.register(receiver.socket, zmq.POLLIN)
    gc.freeze()
    while True:
        poller.poll()
        while (packet := receiver.receive()) is not None:
            sender.send(packet)  # type: ignore[arg-type]  # both ends are of one transport


if __name__ == "__main__":
    main(int(sys.argv[1]))
