"""What ``feasibility inspect`` tells: counts, margins, the solver's agreement and time."""

import io
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.dataset.dataset import Dataset, read_dataset
from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path
from feasibility.sims_flanagan import Status, solve_max_initial_mass

PICTURE: Final = "margin.png"
"""Name of the picture that `inspect_dataset` leaves in the folder."""

_EDGES: Final = np.array(
    [-np.inf, -1.0, -0.5, -0.25, -0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, np.inf]
)
_BAR: Final = 40
_CLOSE: Final = 0.002
_WORSE: Final = 0.005
_NEAR_BOUNDARY: Final = 0.005


def inspect_dataset(folder: Path, *, resolve: int = 0) -> str:
    """Describe a dataset as text and leave a picture of its margins in its folder.

    Parameters
    ----------
    folder : Path
        The dataset.
    resolve : int
        Legs drawn at random whose m* is found again by the reference solver.

    Raises
    ------
    InputError
        The dataset cannot be read, the picture cannot be written, or `resolve` is below zero.
    """
    if resolve < 0:
        raise InputError(f"--resolve {resolve}: expected zero or more")
    dataset = read_dataset(folder)
    parts = [_counts(dataset), _histogram(dataset)]
    if resolve:
        parts.append(_agreement(dataset, resolve))
    _draw(dataset, folder / PICTURE)
    parts.append(f"picture: {folder / PICTURE}")
    return "\n\n".join(parts)


def _counts(dataset: Dataset) -> str:
    protocol = dataset.metadata["protocol"]
    catalogue = dataset.metadata["catalogue"]
    columns = dataset.columns
    n = len(dataset)
    lines = [
        f"{protocol['name']}: {n} legs, seed {dataset.metadata['seed']}, "
        f"{catalogue['bodies']} bodies from {catalogue['source']}",
        f"{'label':<32}{protocol['label']:>10}",
        _row("labelled", dataset.labelled),
        _row("feasible", dataset.feasible),
    ]
    if protocol["label"] == "convergence":
        lines.append(_row("flyable by margin", columns["log_margin"] >= 0.0))
    for status in Status:
        name = status.name.lower().replace("_", " ")
        lines.append(_row(f"status {status.value}, {name}", columns["status"] == status))
    lines.append(_row("initial mass near the boundary", columns["boundary_draw"]))
    seconds = columns["seconds"]
    lines.append(f"{'solver, median ms a leg':<32}{1e3 * np.median(seconds):>10.3g}")
    lines.append(f"{'solver, mean ms a leg':<32}{1e3 * seconds.mean():>10.3g}")
    return "\n".join(lines)


def _row(name: str, where: NDArray[np.bool_]) -> str:
    return f"{name:<32}{int(where.sum()):>10}{100.0 * where.mean():>9.2f} %"


def _histogram(dataset: Dataset) -> str:
    margin = dataset.columns["log_margin"]
    counts, _ = np.histogram(margin[np.isfinite(margin)], bins=_EDGES)
    longest = max(int(counts.max()), 1)
    lines = ["log(m*/m0)            legs"]
    for low, high, count in zip(_EDGES[:-1], _EDGES[1:], counts, strict=True):
        bar = "#" * round(_BAR * count / longest)
        lines.append(f"{low:>6.2f} to {high:>5.2f}{count:>10}  {bar}".rstrip())
    return "\n".join(lines)


def _agreement(dataset: Dataset, resolve: int) -> str:
    known = np.flatnonzero(np.isfinite(dataset.columns["log_margin"]))
    rng = np.random.default_rng(0)
    rows = np.sort(rng.choice(known, min(resolve, len(known)), replace=False))
    sample = dataset.take(rows)
    again = solve_max_initial_mass(sample.legs, method="reference")
    found = again.converged
    log_ratio = np.log(sample.columns["m_star_kg"][found] / again.m0[found])
    margin = sample.columns["log_margin"][found]
    same = (margin >= 0.0) == (margin - log_ratio >= 0.0)
    clear = np.abs(margin) >= _NEAR_BOUNDARY
    lines = [
        f"{len(rows)} legs solved again with the reference solver",
        _row("reference converged", found),
    ]
    if found.any():
        lines += [
            _row("m* equal within 0.2 %", np.abs(log_ratio) <= _CLOSE),
            _row("m* of the dataset larger", log_ratio > _CLOSE),
            _row("m* of the dataset 0.5 % smaller", log_ratio < -_WORSE),
            _row("same side of the boundary", same),
        ]
    if clear.any():
        lines.append(_row("the same, |log(m*/m0)| >= 0.005", same[clear]))
    lines.append(f"{'reference, median ms a leg':<32}{1e3 * np.median(again.seconds):>10.3g}")
    return "\n".join(lines)


def _draw(dataset: Dataset, path: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    margin = dataset.columns["log_margin"]
    margin = np.clip(margin[np.isfinite(margin)], -2.0, 2.0)
    redrawn = dataset.columns["boundary_draw"][np.isfinite(dataset.columns["log_margin"])]
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    bins = np.linspace(-2.0, 2.0, 81).tolist()
    groups = {"first draw": margin[~redrawn], "drawn near the boundary": margin[redrawn]}
    shown = {name: values for name, values in groups.items() if len(values)}
    axes.hist(list(shown.values()), bins=bins, stacked=True, label=list(shown))
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_xlabel("log(m*/m0), cut to -2 to 2; flyable to the right of 0")
    axes.set_ylabel("legs")
    axes.set_title(
        f"{dataset.metadata['protocol']['name']}: {len(dataset)} legs, "
        f"{100.0 * dataset.feasible.mean():.1f} % feasible"
    )
    if shown:
        axes.legend()
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=120)
    with atomic_path(path) as temporary:
        temporary.write_bytes(picture.getvalue())
