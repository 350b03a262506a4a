"""What is drawn with matplotlib, which is an extra: `pip install kinespace[pictures]`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise ImportError("pictures need matplotlib: pip install kinespace[pictures]") from error

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from library.retrieval import Protocol, Retrieval, Space


def draw_confusions(path: Path, results: Mapping[Space, Retrieval], protocol: Protocol) -> None:
    """Draw one confusion matrix per space side by side, as the paper's figure 2.

    Parameters
    ----------
    path
        The picture; its ending says which kind (.png, .svg, .pdf).
    results
        What came out in each space.
    protocol
        Under which protocol, for the title.

    Raises
    ------
    ValueError
        The ending is of no kind matplotlib draws.
    OSError
        The file cannot be written.
    """
    count = len(results)
    figure = Figure(figsize=(1.5 + 4.2 * count, 5.6), layout="constrained")
    figure.suptitle(f"Nearest neighbour, {protocol}")
    panels = figure.subplots(1, count, squeeze=False)[0]
    for panel, (space, result) in zip(panels, results.items(), strict=True):
        image = panel.imshow(result.confusion, cmap="magma_r", vmin=0, vmax=1)
        panel.set_title(f"{space}: {result.nearest:.1%} of {result.motions}")
        ticks = np.arange(len(result.classes))
        panel.set_xticks(ticks, result.classes, rotation=90)
        panel.set_yticks(ticks, result.classes if panel is panels[0] else [""] * len(ticks))
        panel.set_xlabel("class found")
    panels[0].set_ylabel("class performed")
    figure.colorbar(image, ax=panels, shrink=0.7, label="share of the class's motions")
    figure.savefig(path, dpi=110)
