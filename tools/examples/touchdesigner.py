"""TouchDesigner: a Text DAT that sends a squat to kinespace; squat.txt lies next to it. Right-click, Run Script.

It needs an OSC Out DAT called oscout1 (127.0.0.1, port 9310). To get the answers: an OSC In CHOP on port 10000, and
elsewhere: kinespace live --out touchdesigner. Its channel motion/td/class is the class's index, -1 for none.
"""

# op, project and run are TouchDesigner's own.
# ruff: noqa: F821
# mypy: disable-error-code="name-defined"

from pathlib import Path

text = Path(project.folder, "squat.txt").read_text(encoding="utf-8")
frames = [[float(number) for number in line.split()] for line in text.splitlines()]
for number, numbers in enumerate(frames):
    # The performer, the time in seconds (0: the time of arrival), and x y z in metres of HDM05's 31 joints.
    packet = ["/motion/frame", ["td", 0.0, *numbers]]
    run("op('oscout1').sendOSC(*args[0])", packet, delayMilliSeconds=number * 1000 // 30)
