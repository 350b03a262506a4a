"""Print the squat that the examples send: a figure of straight segments, moved by four angles. Nobody performed it.

`python draw_squat.py > squat.txt` writes a line for each frame, thirty a second: x y z in metres of HDM05's 31 joints.
"""

from math import cos, pi, radians, sin

# Frames of one squat; depth 0 is upright, 1 is down.
FRAMES = 50


def figure(depth: float) -> list[tuple[float, float, float]]:
    """Give the joints in HDM05's order: y is up, the figure faces along -z, its left side is at -x."""
    shin, thigh, trunk = radians(28 * depth), radians(85 * depth), radians(22 * depth)
    knee = 0.08 + 0.41 * cos(shin), -0.41 * sin(shin)
    hip = knee[0] + 0.42 * cos(thigh), knee[1] + 0.42 * sin(thigh)

    def above(length: float, forward: float = 0.0) -> tuple[float, float]:
        """Give height and depth of a point of the trunk: so far above the hips, and so far before its axis."""
        return (
            hip[0] + length * cos(trunk) + forward * sin(trunk),
            hip[1] - length * sin(trunk) - forward * cos(trunk),
        )

    def leg(side: float) -> list[tuple[float, float, float]]:
        x = 0.10 * side
        return [(x, *knee), (x, 0.08, 0.0), (1.2 * x, 0.03, -0.10), (1.3 * x, 0.02, -0.17)]

    def arm(side: float) -> list[tuple[float, float, float]]:
        up, out = above(0.52)
        reach = [(0.20, 0.26), (0.17, 0.49), (0.16, 0.57), (0.16, 0.64), (0.13, 0.63), (0.16, 0.70)]
        return [(x * side, up + 0.02, out - z) for x, z in reach]

    return [
        (0.0, *above(0.08)),
        (-0.09, *hip),
        (0.09, *hip),
        (0.0, *above(0.20)),
        *leg(-1.0),
        *leg(1.0),
        *((0.0, *above(length)) for length in (0.33, 0.45, 0.55)),
        (-0.17, *above(0.52)),
        (0.17, *above(0.52)),
        (0.0, *above(0.64, 0.02)),
        (0.0, *above(0.74, 0.03)),
        *arm(-1.0),
        *arm(1.0),
    ]


if __name__ == "__main__":
    for frame in range(FRAMES):
        joints = figure((1 - cos(2 * pi * frame / FRAMES)) / 2)
        print(" ".join(f"{number:.3f}" for joint in joints for number in joint))
