"""The slow twin of the spread and its metric; see `naive` for the rest of the paper's experiment.

Nothing here calls the product.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


def mean(numbers: Sequence[float]) -> float:
    """Add up and divide."""
    return math.fsum(numbers) / len(numbers)


def deviation(numbers: Sequence[float]) -> float:
    """Take the standard deviation of a sample, divided by one less than there are."""
    middle = mean(numbers)
    return math.sqrt(math.fsum((number - middle) ** 2 for number in numbers) / (len(numbers) - 1))


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
