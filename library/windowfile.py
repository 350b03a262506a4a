"""What a library's file holds of its windows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from library.comparison import MEASURES, Comparison, finite
from library.measures import Basis, Body, Kind, Measure
from library.metric import Metric
from library.windowtable import WindowTable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from library.skeleton import Skeleton

#: What names of arrays begin with that are of what fewer joints show.
_SHOWN = "shown_"


def described(table: WindowTable) -> dict[str, object]:
    """Say what a file's header must hold of a table, beside `arrays_of`."""
    header: dict[str, object] = {
        "groups": [[[measure.kind, measure.seconds, weight] for measure, weight in group] for group in table.groups],
        "body_scale": table.comparison.body.scale,
        "outside": {measure.name: metric.outside for measure, metric in table.comparison.metrics.items()},
        "further": table.further,
    }
    if table.shown is not None:
        header["shown"] = described(table.shown)
    return header


def arrays_of(table: WindowTable) -> dict[str, NDArray[np.floating]]:
    """Give the arrays that a file must hold of a table."""
    arrays: dict[str, NDArray[np.floating]] = {
        "window_motions": table.motions.astype(np.float32),
        "window_thresholds": table.thresholds,
        "body_stretches": table.comparison.body.stretches.astype(np.float32),
        "basis": table.comparison.basis.directions.astype(np.float16),
        "basis_weights": table.comparison.basis.weights.astype(np.float16),
    }
    for measure, metric in table.comparison.metrics.items():
        if metric.together.size:
            arrays[f"{measure.name}_together"] = metric.together.astype(np.float16)
            arrays[f"{measure.name}_spare"] = metric.spare.astype(np.float16)
        arrays[f"{measure.name}_origin"] = metric.origin.astype(np.float16)
        arrays[f"{measure.name}_axes"] = metric.axes.astype(np.float16)
    for index, vectors in enumerate(table.vectors):
        arrays[f"window_vectors{index}"] = vectors.astype(np.float16)
    if table.shown is not None and table.directions_shown is not None:
        arrays |= {f"{_SHOWN}{name}": array for name, array in arrays_of(table.shown).items()}
        arrays["directions_shown"] = table.directions_shown.astype(np.float32)
    return arrays


def restored(  # noqa: PLR0913 - the parts of a file, and which part of a table they are
    header: Mapping[str, Any],
    arrays: Mapping[str, NDArray[np.floating]],
    skeleton: Skeleton,
    classes: NDArray[np.intp],
    actors: NDArray[np.str_],
    *,
    whole: bool = True,
) -> WindowTable:
    """Make a table of what `described` and `arrays_of` gave; else raise KeyError, TypeError or ValueError."""
    groups = tuple(
        tuple((Measure(Kind(kind), float(seconds)), float(weight)) for kind, seconds, weight in group)
        for group in header["groups"]
    )
    motions = arrays["window_motions"]
    if not (finite(motions) and np.array_equal(motions, np.rint(motions))):
        raise ValueError("window_motions: expected indices")
    shown = {name.removeprefix(_SHOWN): array for name, array in arrays.items() if name.startswith(_SHOWN)}
    # What is shown is measured only as it is compared.
    measures = MEASURES if whole else [measure for group in groups for measure, _ in group]
    return WindowTable(
        comparison=_restored_comparison(header, arrays, skeleton, measures),
        groups=groups,
        motions=motions.astype(np.intp),
        classes=classes,
        actors=actors,
        vectors=tuple(arrays[f"window_vectors{index}"].astype(np.float32) for index in range(len(groups))),
        thresholds=arrays["window_thresholds"].astype(np.float32),
        further=float(header["further"]),
        shown=restored(header["shown"], shown, skeleton, classes, actors, whole=False) if "shown" in header else None,
        directions_shown=arrays["directions_shown"].astype(np.float64) if "shown" in header else None,
    )


def _restored_comparison(
    header: Mapping[str, Any],
    arrays: Mapping[str, NDArray[np.floating]],
    skeleton: Skeleton,
    measures: Sequence[Measure],
) -> Comparison:
    nothing = {"together": np.zeros((0, 0)), "spare": np.zeros(0)}
    return Comparison(
        body=Body.of(skeleton, float(header["body_scale"]), arrays["body_stretches"].astype(np.float64)),
        basis=Basis(arrays["basis"].astype(np.float64), arrays["basis_weights"].astype(np.float64)),
        metrics={
            measure: Metric(
                origin=arrays[f"{measure.name}_origin"].astype(np.float32),
                axes=arrays[f"{measure.name}_axes"].astype(np.float32),
                outside=float(header["outside"][measure.name]),
                **{
                    name: arrays.get(f"{measure.name}_{name}", empty).astype(np.float32)
                    for name, empty in nothing.items()
                },
            )
            for measure in measures
        },
    )
