"""Learning curve of a margin model as a picture."""

from pathlib import Path

from feasibility.classifier.artefact import Artefact
from feasibility.runtime.atomic import atomic_path


def draw_learning_curve(artefact: Artefact, path: Path) -> None:
    """Write a PNG with the training and validation losses by epoch.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    from matplotlib.figure import Figure

    epochs = artefact.config["epochs"]
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    numbers = [epoch["number"] for epoch in epochs]
    for name, label in (("train_loss", "training"), ("validation_loss", "validation")):
        axes.semilogy(numbers, [epoch[name] for epoch in epochs], "o-", label=label)
    axes.set(xlabel="epoch", ylabel="loss (error of log m*)", title=path.stem)
    axes.grid(alpha=0.3)
    axes.legend()
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=150, format="png")
