"""Pictures drawn with matplotlib, which is an extra: `pip install kinespace[pictures]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

try:
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch
except ImportError as error:
    raise ImportError("pictures need matplotlib: pip install 'kinespace[pictures]'") from error

from kinespace.tools.terminal.output_path import require_place_for

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from kinespace.tools.evaluation.scoring.retrieval import Protocol, Retrieval
    from kinespace.tools.evaluation.scoring.timeline import Course


def require_place_for_picture(path: Path) -> None:
    """Refuse a picture that could not be written, before the work begins.

    Raises
    ------
    ValueError
        Matplotlib has no format of this ending.
    OSError
        It is a folder, or its folder does not exist or is not writable.
    """
    require_place_for(path)
    kinds = Figure().canvas.get_supported_filetypes()
    if path.suffix and path.suffix.lower().lstrip(".") not in kinds:
        raise ValueError(f"{path}: expected a picture's ending, one of {', '.join(sorted(kinds))}, got {path.suffix}")


def draw_phases(
    path: Path,
    class_name: str,
    courses: Mapping[float, tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.floating]]],
) -> None:
    """Draw the phase of one motion against time, played at several speeds.

    Parameters
    ----------
    path
        The picture; its ending says which kind (.png, .svg, .pdf).
    class_name
        Of the motion.
    courses
        For each speed the times, seconds, the phase estimated at each, and the true one.

    Raises
    ------
    ValueError
        The ending is of no kind matplotlib draws.
    OSError
        The file cannot be written.
    """
    figure = Figure(figsize=(7.2, 3.2), layout="constrained")
    panel = figure.subplots()
    for (speed, (times, estimated, true)), colour in zip(
        courses.items(), ("#3b6ea5", "#b5367a", "#2e8b57"), strict=False
    ):
        panel.plot(times, true, color=colour, linewidth=1, linestyle=(0, (4, 3)))
        panel.plot(times, estimated, color=colour, linewidth=2, label=f"{speed:g} × its speed")
    panel.plot([], [], color="#5f6a72", linewidth=1, linestyle=(0, (4, 3)), label="true phase")
    panel.set_title(f"{class_name} of a person who is not in the library", loc="left", fontsize=10)
    panel.set_xlabel("seconds")
    panel.set_ylabel("phase")
    panel.set_ylim(-0.02, 1.02)
    panel.set_xlim(0)
    panel.legend(frameon=False, fontsize=9)
    panel.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)


def draw_confusions(path: Path, results: Mapping[str, Retrieval], protocol: Protocol) -> None:
    """Draw confusion matrices side by side, as the paper's figure 2.

    Parameters
    ----------
    path
        The picture's file; its ending sets the format (.png, .svg, .pdf).
    results
        The outcomes, by their titles.
    protocol
        The protocol, for the title.

    Raises
    ------
    ValueError
        Matplotlib has no format of this ending.
    OSError
        The file cannot be written.
    """
    count = len(results)
    figure = Figure(figsize=(1.5 + 4.2 * count, 5.6), layout="constrained")
    figure.suptitle(f"Nearest neighbour, {protocol}")
    panels = figure.subplots(1, count, squeeze=False)[0]
    for panel, (title, result) in zip(panels, results.items(), strict=True):
        image = panel.imshow(result.confusion, cmap="magma_r", vmin=0, vmax=1)
        panel.set_title(f"{title}\n{result.nearest:.1%} of {len(result.asking)}")
        ticks = np.arange(len(result.classes))
        panel.set_xticks(ticks, result.classes, rotation=90)
        panel.set_yticks(ticks, result.classes if panel is panels[0] else [""] * len(ticks))
        panel.set_xlabel("class found")
    panels[0].set_ylabel("class performed")
    figure.colorbar(image, ax=panels, shrink=0.7, label="share of the class's motions")
    figure.savefig(path, dpi=110)


def draw_time_confusion(path: Path, labels: Sequence[str], answers: Sequence[str], shares: NDArray[np.float64]) -> None:
    """Draw, for each performed label, the shares of its time by answered class.

    Parameters
    ----------
    path
        The picture.
    labels, answers
        Performed labels (rows) against answers (columns).
    shares
        Shape (labels, answers), 0 to 1.
    """
    figure = Figure(figsize=(3.5 + 0.45 * len(answers), 3.0 + 0.35 * len(labels)), layout="constrained")
    panel = figure.subplots()
    image = panel.imshow(shares, cmap="magma_r", vmin=0, vmax=1, aspect="auto")
    panel.set_xticks(np.arange(len(answers)), answers, rotation=90)
    panel.set_yticks(np.arange(len(labels)), labels)
    panel.set_xlabel("published")
    panel.set_ylabel("performed")
    figure.colorbar(image, ax=panel, label="share of the label's time")
    figure.savefig(path, dpi=110)


def draw_timelines(path: Path, courses: Sequence[Course], classes: Sequence[str]) -> None:
    """Draw each take over time: performed labels above answers, and below both the raw score.

    Parameters
    ----------
    path
        The picture.
    courses
        One per take.
    classes
        Class names in the order of the indices. Each class has a colour; motion of no class is grey.
    """
    colours = colormaps["tab20"](np.arange(len(classes)) % 20)
    figure = Figure(figsize=(13, 2.9 * len(courses)), layout="constrained")
    panels = figure.subplots(2 * len(courses), 1, squeeze=False, height_ratios=[3, 2] * len(courses))[:, 0]
    for course, bands, curve in zip(courses, panels[::2], panels[1::2], strict=True):
        _draw_bands(bands, course, classes, colours)
        curve.plot(course.times, course.score, color="black", linewidth=0.8)
        curve.set_ylim(0, 1)
        curve.set_ylabel("score")
        for panel in (bands, curve):
            panel.set_xlim(course.times[0], course.times[-1])
    panels[-1].set_xlabel("seconds")
    shown = np.unique(np.concatenate([track for each in courses for track in (each.truth, each.published, each.event)]))
    patches = [Patch(color=colours[index], label=classes[index]) for index in shown if index >= 0]
    figure.legend(handles=patches, loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(path, dpi=110)


def _draw_bands(panel: Axes, course: Course, classes: Sequence[str], colours: NDArray[np.float64]) -> None:
    panel.set_title(course.name, loc="left")
    panel.set_yticks([2.5, 1.5, 0.5], ["performed", "published", "event"])
    panel.set_ylim(0, 3)
    known = dict(zip(classes, colours, strict=True))
    for segment in course.segments:
        colour = known.get(segment.label, "lightgrey")
        panel.broken_barh([(segment.start, segment.duration)], (2.05, 0.9), color=colour)
        panel.text(segment.start + segment.duration / 2, 2.5, segment.label, ha="center", va="center", fontsize=8)
    for track, bottom in ((course.published, 1.05), (course.event, 0.05)):
        edges = np.flatnonzero(np.diff(track)) + 1
        for first, last in zip([0, *edges], [*edges, len(track)], strict=True):
            if track[first] >= 0:
                begin, end = course.times[first], course.times[last - 1]
                panel.broken_barh([(begin, end - begin)], (bottom, 0.9), color=colours[track[first]])
