"""BlazePose's pictures and numbers, as MediaPipe's C++ writes them down: one number after the other.

`ssd_anchors_calculator.cc`, `tensors_to_detections_calculator.cc`, `non_max_suppression_calculator.cc` (WEIGHTED),
`alignment_points_to_rects_calculator.cc`, `rect_transformation_calculator.cc`, `landmark_projection_calculator.cc`,
`world_landmark_projection_calculator.cc`, `refine_landmarks_from_heatmap_calculator.cc`.
"""

import math
from typing import Any

Numbers = Any


def anchors() -> list[tuple[float, float]]:
    """Strides 8, 16, 32, 32, 32; two anchors for each layer; equal strides share a grid."""
    strides, centres, layer = (8, 16, 32, 32, 32), [], 0
    while layer < len(strides):
        same = layer
        while same < len(strides) and strides[same] == strides[layer]:
            same += 1
        side = math.ceil(224 / strides[layer])
        for y in range(side):
            for x in range(side):
                centres += [((x + 0.5) / side, (y + 0.5) / side)] * 2 * (same - layer)
        layer = same
    return centres


def decoded(boxes: Numbers, scores: Numbers) -> list[tuple[float, list[float], list[list[float]]]]:
    """Give score, box (left, top, right, bottom) and points of each anchor from a score of a half on."""
    found = []
    for raw, logit, (x, y) in zip(boxes, scores, anchors(), strict=True):
        score = 1 / (1 + math.exp(-max(-100.0, min(100.0, float(logit)))))
        if score < 0.5:
            continue
        middle = raw[0] / 224 + x, raw[1] / 224 + y
        width, height = raw[2] / 224, raw[3] / 224
        box = [middle[0] - width / 2, middle[1] - height / 2, middle[0] + width / 2, middle[1] + height / 2]
        points = [[raw[4 + 2 * each] / 224 + x, raw[5 + 2 * each] / 224 + y] for each in range(4)]
        found.append((score, box, points))
    return sorted(found, key=lambda each: -each[0])


def overlap(one: Numbers, other: Numbers) -> float:
    """Intersection over union."""
    across = min(one[2], other[2]) - max(one[0], other[0])
    down = min(one[3], other[3]) - max(one[1], other[1])
    if across <= 0 or down <= 0:
        return 0.0
    area = (one[2] - one[0]) * (one[3] - one[1]) + (other[2] - other[0]) * (other[3] - other[1]) - across * down
    return float(across * down / area)


def weighted(found: Numbers) -> list[tuple[float, list[float], list[list[float]]]]:
    """Average all that overlap the surest by more than .3; go on with the rest."""
    left, bodies = list(found), []
    while left:
        first = left[0]
        same = [each for each in left if each is first or overlap(each[1], first[1]) > 0.3]
        left = [each for each in left if all(each is not one for one in same)]
        total = sum(each[0] for each in same)
        box = [sum(each[0] * each[1][place] for each in same) / total for place in range(4)]
        points = [[sum(each[0] * each[2][k][a] for each in same) / total for a in range(2)] for k in range(4)]
        bodies.append((first[0], box, points))
    return bodies


def region(middle: Numbers, circle: Numbers) -> tuple[float, float, float, float]:
    """Centre, side and turn of the square around a body."""
    x0, y0, x1, y1 = *map(float, middle), *map(float, circle)
    side = 2 * math.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    angle = math.pi / 2 - math.atan2(-(y1 - y0), x1 - x0)
    return x0, y0, side * 1.25, angle - 2 * math.pi * math.floor((angle + math.pi) / (2 * math.pi))


def projected(point: Numbers, where: Numbers, side: int) -> tuple[float, float]:
    """Bring a point of the cut out square to the picture."""
    middle_x, middle_y, size, angle = where
    x, y = point[0] / side - 0.5, point[1] / side - 0.5
    return (
        (math.cos(angle) * x - math.sin(angle) * y) * size + middle_x,
        (math.sin(angle) * x + math.cos(angle) * y) * size + middle_y,
    )


def turned(point: Numbers, angle: float) -> tuple[float, float, float]:
    """Turn a world landmark back."""
    x, y, z = map(float, point)
    return math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x + math.cos(angle) * y, z


def refined(point: Numbers, heat: Numbers) -> tuple[float, float]:
    """Move a landmark (pixels of 256) to the middle of the heat (cells, cells) in the 7 cells around it."""
    cells = len(heat)
    column, row = int(point[0] / 256 * cells), int(point[1] / 256 * cells)
    if not (0 <= column < cells and 0 <= row < cells):
        return float(point[0]), float(point[1])
    total = across = down = most = 0.0
    for y in range(max(0, row - 3), min(cells, row + 4)):
        for x in range(max(0, column - 3), min(cells, column + 4)):
            warm = 1 / (1 + math.exp(-float(heat[y][x])))
            total, most = total + warm, max(most, warm)
            across, down = across + x * warm, down + y * warm
    if most < 0.5:
        return float(point[0]), float(point[1])
    return across / total / cells * 256, down / total / cells * 256
