"""The slow twin of what is measured of windows and how they are compared; see `naive` for the rest.

Nothing here calls the product: trees are walked, sums are added up one by one, matrices are written out and inverted.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]


# --- what is measured --------------------------------------------------------------------------------------------


def mean(numbers: Sequence[float]) -> float:
    """Add up and divide."""
    return math.fsum(numbers) / len(numbers)


def deviation(numbers: Sequence[float]) -> float:
    """Take the standard deviation of a sample, divided by one less than there are."""
    middle = mean(numbers)
    return math.sqrt(math.fsum((number - middle) ** 2 for number in numbers) / (len(numbers) - 1))


def segments(parents: Sequence[int]) -> list[tuple[int, int]]:
    """Name each joint with its parent, the smaller first."""
    return [(min(joint, parent), max(joint, parent)) for joint, parent in enumerate(parents) if parent >= 0]


def path_between(first: int, second: int, parents: Sequence[int]) -> list[tuple[int, int]]:
    """Walk from one joint up the tree until the other's way up is met, and down to the other: the segments crossed."""
    ways = []
    for joint in (first, second):
        way = [joint]
        while parents[way[-1]] >= 0:
            way.append(parents[way[-1]])
        ways.append(way)
    meeting = next(joint for joint in ways[0] if joint in ways[1])
    crossed = []
    for way in ways:
        for joint in way[: way.index(meeting)]:
            crossed += [(min(joint, parents[joint]), max(joint, parents[joint]))]
    return crossed


def body_size(means: Mapping[tuple[int, int], float], parents: Sequence[int]) -> float:
    """Take the mean length of the segments."""
    return mean([means[segment] for segment in segments(parents)])


def spread(rows: Matrix, pairs: Sequence[tuple[int, int]], parents: Sequence[int]) -> list[float]:
    """Take log deviations relative to the body's size, a 60th added before, and half their mean away after."""
    columns = rows.T.tolist()
    size = body_size({pair: mean(column) for pair, column in zip(pairs, columns, strict=True)}, parents)
    logs = [math.log(deviation(column) / size + 1 / 60) for column in columns]
    return [log - mean(logs) / 2 for log in logs]


def posture(rows: Matrix, pairs: Sequence[tuple[int, int]], parents: Sequence[int]) -> list[float]:
    """Divide each mean distance by the mean lengths of the segments that lead from one joint to the other."""
    means = {pair: mean(column) for pair, column in zip(pairs, rows.T.tolist(), strict=True)}
    return [
        means[first, second] / math.fsum(means[segment] for segment in path_between(first, second, parents))
        for first, second in pairs
    ]


def shape(covariance: Matrix) -> list[float]:
    """Write the lower factor L of a covariance of trace 1 plus a thousandth, L Lᵀ, row by row, number by number."""
    size = len(covariance)
    total = math.fsum(covariance[i, i] for i in range(size))
    factor = [[0.0] * size for _ in range(size)]
    for i in range(size):
        for j in range(i + 1):
            left = covariance[i, j] / total + (0.001 if i == j else 0.0)
            left -= math.fsum(factor[i][k] * factor[j][k] for k in range(j))
            factor[i][j] = math.sqrt(left) if i == j else left / factor[j][j]
    return [factor[i][j] for i in range(size) for j in range(i + 1)]


def basis(classes: Sequence[Sequence[Matrix]], sizes: Sequence[Sequence[float]], directions: int) -> Matrix:
    """Find the principal axes of the correlations, averaged over motions and then over classes.

    Parameters
    ----------
    classes
        For each class its motions' distance rows.
    sizes
        For each class its motions' body sizes.
    directions
        How many.
    """
    count = classes[0][0].shape[1]
    total = np.zeros((count, count))
    for motions, their_sizes in zip(classes, sizes, strict=True):
        for rows, size in zip(motions, their_sizes, strict=True):
            centred = (rows - rows.mean(axis=0)) / size
            total += centred.T @ centred / len(rows) / len(motions) / len(classes)
    variances = [total[i, i] for i in range(count)]
    scales = [1 / math.sqrt(v) if v > mean(variances) / 1000 else 0.0 for v in variances]
    correlation = np.diag(scales) @ total @ np.diag(scales)
    values, vectors = scipy.linalg.eigh(correlation)
    order = sorted(range(count), key=lambda index: -values[index])[:directions]
    return np.diag(scales) @ vectors[:, order]


# --- how windows are compared ------------------------------------------------------------------------------------


def squared_distance(first: Sequence[float], second: Sequence[float]) -> float:
    """Add up squared differences."""
    return math.fsum((a - b) ** 2 for a, b in zip(first, second, strict=True))


def within_class_metric(spreads: Matrix, classes: Sequence[str], shrinkage: float) -> Matrix:
    """Invert the within-class scatter, each class weighing the same, drawn towards equal scatter."""
    numbers = spreads.shape[1]
    scatter = np.zeros((numbers, numbers))
    for name in sorted(set(classes)):
        own = spreads[[index for index, other in enumerate(classes) if other == name]]
        for row in own:
            difference = row - own.mean(axis=0)
            scatter += np.outer(difference, difference) / len(own) / len(set(classes))
    equal = np.trace(scatter) / numbers * np.eye(numbers)
    return np.linalg.inv((1 - shrinkage) * scatter + shrinkage * equal)


def metric_between_people(
    measures: Matrix, classes: Sequence[int], actors: Sequence[str], shrinkage: float, kept: int
) -> Matrix:
    """Learn what differs between people doing the same, and give the matrix M of the squared distance dᵀ M d."""
    numbers = measures.shape[1]
    centred = measures - measures.mean(axis=0)
    matrix = _leading(centred, np.eye(numbers), kept)
    scatter = np.eye(numbers)
    for _ in range(2):
        scatter = np.zeros((numbers, numbers))
        shared = sorted({c for c in classes if len({a for a, d in zip(actors, classes, strict=True) if d == c}) > 1})
        for index in shared:
            own = [window for window, other in enumerate(classes) if other == index]
            for window in own:
                others = [other for other in own if actors[other] != actors[window]]
                between = [measures[window] - measures[other] for other in others]
                nearest = min(between, key=lambda difference: float(difference @ matrix @ difference))
                scatter += np.outer(nearest, nearest) / len(own) / len(shared)
        shrunk = (1 - shrinkage) * scatter / (np.trace(scatter) / numbers) + shrinkage * np.eye(numbers)
        matrix = _leading(centred, np.linalg.inv(scipy.linalg.sqrtm(shrunk).real), kept)
    return matrix / np.trace(matrix @ scatter)


def _leading(centred: Matrix, whitening: Matrix, kept: int) -> Matrix:
    """Keep the leading principal axes of whitened measures."""
    white = centred @ whitening
    values, vectors = np.linalg.eigh(white.T @ white)
    axes = vectors[:, sorted(range(len(values)), key=lambda index: -values[index])[:kept]]
    return whitening @ axes @ axes.T @ whitening


def log_distances(  # noqa: PLR0913 - the asking window, the library's windows with their two labels, and the floor
    asked: Sequence[Sequence[float]],
    outside: Sequence[float],
    vectors: Sequence[Matrix],
    classes: Sequence[int],
    actors: Sequence[str],
    *,
    floor: float,
) -> list[float]:
    """For each class find the window nearest in all groups together, person by person, and let two people agree.

    Parameters
    ----------
    asked
        For each group the asking window's vector.
    outside
        For each group what the asking window lies off the axes, squared.
    vectors
        For each group the library's windows.
    classes, actors
        Of each of the library's windows.
    floor
        Added before the logarithm.
    """
    far = [
        mean(
            [
                math.log(squared_distance(own, windows[window].tolist()) + off + floor)
                for own, off, windows in zip(asked, outside, vectors, strict=True)
            ]
        )
        for window in range(len(classes))
    ]
    return [
        agreement([(actors[k], far[k]) for k in range(len(far)) if classes[k] == index])
        for index in sorted(set(classes))
    ]


def agreement(found: Sequence[tuple[str, float]]) -> float:
    """Of what was found at whom, take each person's least, and of these the mean of the two least, or the only one."""
    least = sorted(min(far for whose, far in found if whose == actor) for actor in {whose for whose, _ in found})
    return mean(least[:2])


def quantile(numbers: Sequence[float], share: float) -> float:
    """Find the number below which a share of the numbers lies, in a straight line between neighbours."""
    ordered = sorted(numbers)
    place = share * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def thresholds(  # noqa: PLR0913 - the windows with their labels, what is asked for, and how they ask
    vectors: Sequence[Matrix],
    classes: Sequence[int],
    actors: Sequence[str],
    rates: Sequence[float],
    *,
    floor: float,
    asked: Sequence[Matrix] | None = None,
    outside: Sequence[Sequence[float]] | None = None,
) -> list[float]:
    """Leave each class out in turn, let its windows ask, and average the quantiles of the nearest they find.

    Parameters
    ----------
    vectors
        For each group the library's windows.
    classes, actors
        Of each window; whoever asks does not find windows of the same actor, where there are several actors.
    rates
        Shares of impostors to be answered.
    floor
        Added to squared distances before the logarithm.
    asked, outside
        For each group what the windows ask with, and for each window what it lies off the axes in each group, squared;
        when not given they ask with what is in the library.
    """
    count, several = len(classes), len(set(actors)) > 1
    asked = vectors if asked is None else asked
    off = [[0.0] * len(vectors)] * count if outside is None else outside
    by_class = []
    for left_out in sorted(set(classes)):
        found = []
        for asking in (window for window in range(count) if classes[window] == left_out):
            there = [
                window
                for window in range(count)
                if classes[window] != left_out and not (several and actors[window] == actors[asking])
            ]
            far = {
                window: mean(
                    [
                        math.log(squared_distance(own[asking], each[window]) + beyond + floor)
                        for own, each, beyond in zip(asked, vectors, off[asking], strict=True)
                    ]
                )
                for window in there
            }
            agreed = [
                agreement([(actors[window], far[window]) for window in there if classes[window] == other])
                for other in {classes[window] for window in there}
            ]
            found += [min(agreed)] if agreed else []
        if found:
            by_class.append(found)
    return [mean([quantile(found, rate) for found in by_class]) if by_class else math.inf for rate in rates]


def conditional_mean(  # noqa: PLR0913 - what is learned from, what is seen, and of whom
    measures: Matrix, vectors: Matrix, seen: Sequence[int], asked: Matrix, *, level: float, least: float
) -> Matrix:
    """Give the mean of jointly normal vectors when some of a measure's numbers are seen, from the whole covariance.

    Numbers are what the vectors tell of them in a straight line, and noise of their own; they are tied together as they
    were before a share of their mean was taken out.

    Parameters
    ----------
    measures, vectors
        What is learned from, window by window.
    seen
        Which numbers are seen.
    asked
        Those numbers of the asking windows, freed of their own mean.
    level
        Share of the mean that was taken out.
    least
        Least variance of the noise.
    """
    count, kept = measures.shape[1], vectors.shape[1]
    centred = measures - measures.mean(axis=0)
    told, *_ = scipy.linalg.lstsq(vectors, centred)
    noise = [max(mean([far**2 for far in column]), least) for column in (centred - vectors @ told).T.tolist()]
    back = np.linalg.inv(np.eye(count) - level / count * np.ones((count, count)))
    varying = np.block([np.eye(kept), told @ back])
    joint = varying.T @ (vectors.T @ vectors / len(vectors)) @ varying
    joint[kept:, kept:] += np.diag(noise)
    places = [kept + number for number in seen]
    fewer = np.linalg.inv(np.eye(len(seen)) - level / len(seen) * np.ones((len(seen), len(seen))))
    beyond = asked @ fewer - (measures.mean(axis=0) @ back)[list(seen)]
    return beyond @ np.linalg.inv(joint[np.ix_(places, places)]) @ joint[np.ix_(places, range(kept))]


# --- labels ------------------------------------------------------------------------------------------------------


def frames_within(frames: int, frame_rate: float, start: float, end: float) -> list[int]:
    """Say which frames' middles lie within a stretch of time."""
    return [frame for frame in range(frames) if start <= (frame + 0.5) / frame_rate < end]


# --- fewer joints ------------------------------------------------------------------------------------------------


def sizes_and_stretches(
    means: Sequence[Mapping[tuple[int, int], float]],
    parents: Sequence[int],
    fewer_parents: Sequence[int],
    joints: Sequence[int],
) -> tuple[float, dict[tuple[int, int], float]]:
    """Say by how much a body is larger than its fewer joints show, and its paths longer, in the mean over some people.

    Parameters
    ----------
    means
        For each person the distance of each pair of joints.
    parents, fewer_parents
        Of each joint, and of each of the fewer.
    joints
        Which joints the fewer are, in order.
    """
    sizes, stretches = [], dict[tuple[int, int], list[float]]()
    for whole in means:
        places = range(len(joints))
        seen = {(a, b): whole[joints[a], joints[b]] for a in places for b in places if a < b}
        sizes.append(body_size(whole, parents) / body_size(seen, fewer_parents))
        for first, second in seen:
            long = math.fsum(whole[each] for each in path_between(joints[first], joints[second], parents))
            short = math.fsum(seen[each] for each in path_between(first, second, fewer_parents))
            stretches.setdefault((first, second), []).append(long / short)
    return mean(sizes), {pair: mean(found) for pair, found in stretches.items()}


def course_seen(row: Matrix, directions: Matrix, weights: Matrix, seen: Sequence[int], clear: float) -> Matrix:
    """Find where a row of fewer distances stands along directions, by least squares over what shows clearly in them.

    Weighted rows are directions (orthonormal ones) times a course, and what is across them. The normal equations are
    solved along those of their eigenvectors that show at least `clear` times as much as the one that shows most.
    """
    whole = [[d / w if w > 0 else 0.0 for d in line] for line, w in zip(directions.tolist(), weights, strict=True)]
    orthonormal = np.array([whole[pair] for pair in seen])
    swung = np.array([row[place] * weights[pair] for place, pair in enumerate(seen)])
    values, vectors = scipy.linalg.eigh(orthonormal.T @ orthonormal)
    course = np.zeros(directions.shape[1])
    for value, vector in zip(values.tolist(), vectors.T, strict=True):
        if math.sqrt(max(value, 0.0)) > clear * math.sqrt(values.max()):
            course += vector * float(vector @ orthonormal.T @ swung) / value
    return course


def vector_seen(  # noqa: PLR0913 - the measure, what was learned, and which of its numbers are seen
    measure: Matrix,
    *,
    origin: Matrix,
    axes: Matrix,
    together: Matrix,
    spare: Matrix,
    seen: Sequence[int],
    level_removed: float,
) -> Matrix:
    """Estimate a vector from fewer numbers of a measure: E[z | x] of normally distributed z and x.

    Cov(z, x) (Cov x)⁻¹ (x - origin), the covariance of the numbers seen being what the vectors tell and the spare. The
    mean of which a share was taken away is first put back, in the measure as in what was learned.
    """

    def whole(numbers: Matrix) -> Matrix:
        return np.asarray(numbers + level_removed / (1 - level_removed) * numbers.mean(axis=-1, keepdims=True))

    prior = (together @ axes + (together @ axes).T) / 2
    decoder = whole(np.linalg.inv(prior) @ together)[:, seen]
    covariance = decoder.T @ prior @ decoder + np.diag(spare[seen])
    return np.asarray(prior @ decoder @ np.linalg.inv(covariance) @ (whole(measure) - whole(origin)[seen]))


def vector_shown(  # noqa: PLR0913 - the vector, what was learned, and which numbers are seen
    vector: Matrix,
    *,
    origin: Matrix,
    axes: Matrix,
    together: Matrix,
    spare: Matrix,
    seen: Sequence[int],
    level_removed: float,
) -> Matrix:
    """Make the measure that a vector stands for, look at fewer of its numbers, and estimate the vector from those."""
    prior = (together @ axes + (together @ axes).T) / 2
    measure = origin + vector @ np.linalg.inv(prior) @ together
    fewer = (measure + level_removed / (1 - level_removed) * measure.mean())[seen]
    return vector_seen(
        fewer - level_removed * fewer.mean(),
        origin=origin,
        axes=axes,
        together=together,
        spare=spare,
        seen=seen,
        level_removed=level_removed,
    )


def shape_shown(shape_vector: Sequence[float], directions: Matrix) -> list[float]:
    """Multiply the triangle out to the covariance it is of, look at it along some directions, and take its shape."""
    size = len(directions)
    triangle = np.zeros((size, size))
    numbers = iter(shape_vector)
    for i in range(size):
        for j in range(i + 1):
            triangle[i, j] = next(numbers)
    covariance = [[math.fsum(triangle[i] * triangle[j]) for j in range(size)] for i in range(size)]
    return shape(directions.T @ np.array(covariance) @ directions)


def named_and_known(  # noqa: PLR0913 - both of the asking window and of the library's, and the windows' labels
    asked: Sequence[Sequence[float]],
    outside: Sequence[float],
    vectors: Sequence[Matrix],
    *,
    cut: Sequence[Sequence[float]],
    cut_outside: Sequence[float],
    cut_vectors: Sequence[Matrix],
    shapes: Sequence[bool],
    told: float,
    classes: Sequence[int],
    actors: Sequence[str],
    floor: float,
) -> list[list[float]]:
    """Compare a window of fewer joints twice: by which it is named, and by which it is known.

    Known by what is cut alone. Named by the whole vectors, but for shapes by both, the whole one weighing as much as
    the share of directions told.
    """
    both = []
    for window in range(len(classes)):
        logs, cut_logs = [], []
        for index, is_shape in enumerate(shapes):
            whole = squared_distance(asked[index], vectors[index][window].tolist()) + outside[index] + floor
            left = squared_distance(cut[index], cut_vectors[index][window].tolist()) + cut_outside[index] + floor
            share = told if is_shape else 1.0
            logs.append(share * math.log(whole) + (1 - share) * math.log(left))
            cut_logs.append(math.log(left))
        both.append((mean(logs), mean(cut_logs)))
    return [
        [
            agreement([(actors[k], both[k][which]) for k in range(len(both)) if classes[k] == index])
            for index in sorted(set(classes))
        ]
        for which in (0, 1)
    ]
