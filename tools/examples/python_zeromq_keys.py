"""Send a squat to kinespace by ZeroMQ and print its answers; both ends know each other by their keys. With pyzmq.

First, elsewhere: kinespace keys stage, kinespace keys ann, cp ann/ann.key stage/, cp stage/stage.key ann/, and
kinespace live --keys stage --zmq-in tcp://127.0.0.1:9320 --zmq-out tcp://127.0.0.1:9321
"""

import json
import sys
import time
from array import array
from pathlib import Path

import zmq
from zmq.auth import load_certificate

# Where kinespace listens and answers, this program's key pair, kinespace's public key, and how often to squat.
FRAMES_TO, ANSWERS_FROM, OWN, THEIRS = sys.argv[1:5]
TIMES = int(sys.argv[5]) if len(sys.argv) > 5 else 5
FRAMES = [line.split() for line in Path(__file__).with_name("squat.txt").read_text(encoding="utf-8").splitlines()]

context = zmq.Context()


def connected(kind: int, address: str) -> zmq.Socket[bytes]:
    """Connect to kinespace, with keys."""
    made = context.socket(kind)
    made.curve_publickey, made.curve_secretkey = load_certificate(OWN)
    made.curve_serverkey, _ = load_certificate(THEIRS)
    made.linger = 0
    made.connect(address)
    return made


frames, answers = connected(zmq.PUB, FRAMES_TO), connected(zmq.SUB, ANSWERS_FROM)
answers.subscribe(b"event/")
answers.subscribe(b"status/")
# A status comes each second: the first one shows that kinespace has let us in. Messages before it are lost.
answers.recv_multipart()
answers.unsubscribe(b"status/")

due = time.monotonic()
for number in range(TIMES * len(FRAMES)):
    # The performer, the description of the numbers, and x y z in metres of HDM05's 31 joints.
    header = {"v": 1, "seq": number, "t": 0, "shape": [31, 3], "dtype": "<f4"}
    numbers = [float(each) for each in FRAMES[number % len(FRAMES)]]
    frames.send_multipart([b"frame/python/", json.dumps(header).encode(), array("f", numbers).tobytes()])
    due += 1 / 30
    while answers.poll(round(max(due - time.monotonic(), 0) * 1000)):
        topic, body = answers.recv_multipart()
        if topic.startswith(b"event/"):
            event = json.loads(body)
            print(f"{event['performer']}: {event['class']} {event['event']}s", flush=True)
context.destroy(linger=0)
