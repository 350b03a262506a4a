"""Send a squat to kinespace, 30 frames a second, with python-osc. First start, elsewhere: kinespace live."""

import sys
import time
from pathlib import Path

from pythonosc.udp_client import SimpleUDPClient

# The address on which kinespace listens, and the number of squats.
PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 9310
TIMES = int(sys.argv[2]) if len(sys.argv) > 2 else 5
# A line for each frame: x y z in metres of HDM05's 31 joints. Joints of other names or in another order:
# send_message("/motion/skeleton", ["python", "Hips", "Spine", ...]) at the start and every second.
FRAMES = [[float(number) for number in line.split()] for line in Path(__file__).with_name("squat.txt").open()]

client = SimpleUDPClient("127.0.0.1", PORT)
due = time.monotonic()
for _ in range(TIMES):
    for numbers in FRAMES:
        # The performer, the time in seconds (0: the time of arrival), and the positions.
        client.send_message("/motion/frame", ["python", 0.0, *numbers])
        due += 1 / 30
        time.sleep(max(due - time.monotonic(), 0))
