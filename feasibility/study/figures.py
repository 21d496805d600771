"""How the figures of a study look."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette: told apart with any colour vision.
COLOURS: Final = {
    "ensemble": "#E69F00",
    "knn": "#56B4E9",
    "svm": "#009E73",
    "tree": "#CC79A7",
    "dnn1": "#0072B2",
    "dnn2": "#D55E00",
    "margin": "#000000",
}
"""Colour of each model in every figure."""

NAMES: Final = {
    "ensemble": "Ensemble",
    "knn": "KNN",
    "svm": "SVM",
    "tree": "Tree",
    "dnn1": "DNN1",
    "dnn2": "DNN2",
    "margin": "Margin model",
}
"""Name of each model, as the paper prints it; the margin model is ours."""


def panels(
    n: int, *, columns: int = 2, width: float = 4.2, height: float = 3.2
) -> "tuple[Figure, list[Axes]]":
    """Return ``figure, axes`` with n panels, n axes in a flat list; no display is needed."""
    from matplotlib.figure import Figure

    columns = min(n, columns)
    rows = -(-n // columns)
    figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for spare in axes[n:]:
        spare.remove()
    for axis in axes[:n]:
        axis.grid(visible=True, linewidth=0.4, alpha=0.5)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, list(axes[:n])


def error_line(
    axes: "Axes",
    x: Sequence[float],
    mean: Sequence[float],
    deviation: Sequence[float],
    **style: Any,
) -> None:
    """Draw a line with markers and error bars of one standard deviation."""
    axes.errorbar(x, mean, yerr=deviation, marker="o", markersize=4, capsize=2, **style)


def legend(figure: "Figure", axes: "Axes") -> None:
    """Put one legend for all panels above them."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 6))
