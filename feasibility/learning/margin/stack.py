"""`fit_stack`: several nets of one shape at once, on a GPU in one recorded program a step.

A step of one such net is a hundred small operations, and on a GPU starting them takes longer than
doing them. Here the nets of an ensemble are one batch of matrices, and a step is recorded once and
replayed (CUDA graphs), which is what makes ensembles and millions of rows affordable.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.network import INPUT_LIMIT
from feasibility.errors import InputError
from feasibility.learning.margin.fit import (
    LARGEST_GRADIENT,
    LARGEST_MISS,
    SIZE_WEIGHT,
    UNIT,
    WARM_UP,
    device_of,
)
from feasibility.runtime.extras import load_extra

_Array = NDArray[np.float64]

_LEAST_RATE: Final = 0.04
"""Learning rate of the first step, as a share of the largest one."""

_RECORDED_AFTER: Final = 3
_ROWS_AT_ONCE: Final = 200_000


@final
@dataclass(frozen=True)
class StackRecipe:
    """How to train.

    Parameters
    ----------
    count : int
        Nets; each has its own random weights and its own order of the rows.
    layers, width : int
        Hidden layers, and units of each.
    epochs, batch : int
        Passes over the rows, and rows a step.
    learning_rate, weight_decay : float
        The largest learning rate, which rises for a start and falls to zero along half a cosine.
    seed : int
        Seed of weights and orders.
    device : str
        "cpu", "cuda", or "auto" for a GPU where there is one.
    threads : int
        Threads of the processor.

    Raises
    ------
    InputError
        A number is out of range.
    """

    count: int = 8
    layers: int = 4
    width: int = 512
    epochs: int = 100
    batch: int = 1024
    learning_rate: float = 2e-3
    weight_decay: float = 1e-4
    seed: int = 0
    device: str = "auto"
    threads: int = 2

    def __post_init__(self) -> None:
        for name in ("count", "layers", "width", "epochs", "batch", "threads"):
            if getattr(self, name) < 1:
                raise InputError(f"stack {name}: {getattr(self, name)}, expected 1 or more")
        if self.device not in ("cpu", "cuda", "auto"):
            raise InputError(f"stack device: {self.device!r}, expected cpu, cuda or auto")


@final
@dataclass(frozen=True, eq=False)
class Lessons:
    """What nets learn from; n rows.

    Attributes
    ----------
    X : (n, k) float64 or float32
        Inputs.
    target, weight : (n,) float64
        What is to be predicted, and how much each row counts.
    truth : (n,) float64
        The true values, of which the second output learns how far off the prediction is; NaN
        where the target is somebody's opinion.
    """

    X: NDArray[Any]
    target: _Array
    weight: _Array
    truth: _Array


def fit_stack(
    lessons: Lessons,
    recipe: StackRecipe,
    *,
    on_epoch: Callable[[int, float], None] = lambda *_: None,
) -> list[dict[str, _Array]]:
    """Train nets and return the arrays of each for `MarginNet`.

    Parameters
    ----------
    lessons : Lessons
        Rows to learn from.
    recipe : StackRecipe
        How to train.
    on_epoch : callable
        Called with the number of each epoch and the mean loss in it.

    Raises
    ------
    InputError
        There are fewer rows than a batch has.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    n = len(lessons.X)
    if n < recipe.batch:
        raise InputError(f"stack: {n} rows, expected at least one batch of {recipe.batch}")
    torch = load_extra("torch")
    torch.set_num_threads(recipe.threads)
    device = device_of(recipe.device)
    mean, std = _scales(lessons.X)
    if device == "cuda":
        # Factors are cut to ten bits, which is enough for gradients.
        torch.set_float32_matmul_precision("high")
    data = _tensors(torch, lessons, mean, std, device)
    weights = _first_weights(torch, recipe, lessons.X.shape[1], device)
    step = _Step(torch, weights, data, recipe, device)
    batches = n // recipe.batch
    generator = torch.Generator(device=device).manual_seed(recipe.seed + 1)
    for epoch in range(recipe.epochs):
        orders = torch.stack(
            [torch.randperm(n, generator=generator, device=device) for _ in range(recipe.count)]
        )
        total = torch.zeros((), device=device)
        for k in range(batches):
            rate = _rate((epoch * batches + k) / (recipe.epochs * batches))
            total += step.take(orders[:, k * recipe.batch : (k + 1) * recipe.batch], rate)
        on_epoch(epoch + 1, UNIT * float(total) / batches / recipe.count)
    return [_arrays(weights, k, mean, std) for k in range(recipe.count)]


def mean_opinion(
    nets: Sequence[Mapping[str, _Array]], X: NDArray[Any], *, device: str = "auto"
) -> _Array:
    """Return (n,) the mean of what nets of one shape and scale predict for inputs (n, k)."""
    torch = load_extra("torch")
    device = device_of(device)
    first = nets[0]
    layers = sum(name.startswith("weight_") for name in first)
    weights = []
    for i in range(layers):
        for part in (
            np.stack([net[f"weight_{i}"].T for net in nets]),
            np.stack([net[f"bias_{i}"][None] for net in nets]),
        ):
            weights += [torch.from_numpy(part.astype(np.float32)).to(device)]
    found = np.empty(len(X))
    with torch.no_grad():
        for begin in range(0, len(X), _ROWS_AT_ONCE // 8):
            rows = _scaled(X[begin : begin + _ROWS_AT_ONCE // 8], first["mean"], first["std"])
            x = torch.from_numpy(rows).to(device).expand(len(nets), *rows.shape)
            mean_out, _ = _outputs(torch, weights, x)
            found[begin : begin + len(rows)] = mean_out.mean(dim=0).cpu().numpy()
    return found * float(first["unit"])


def _scaled(X: NDArray[Any], mean: _Array, std: _Array) -> NDArray[np.float32]:
    clipped = np.clip((X - mean) / std, -INPUT_LIMIT, INPUT_LIMIT)
    scaled: NDArray[np.float32] = clipped.astype(np.float32)
    return scaled


def _rate(done: float) -> float:
    """Return the learning rate as a share of the largest, after a share of all steps."""
    if done < WARM_UP:
        return _LEAST_RATE + (1.0 - _LEAST_RATE) * 0.5 * (1.0 - math.cos(math.pi * done / WARM_UP))
    return 0.5 * (1.0 + math.cos(math.pi * (done - WARM_UP) / (1.0 - WARM_UP)))


@final
class _Step:
    """One step of all nets; on a GPU it is recorded after a few, and replayed from then on."""

    def __init__(
        self,
        torch: Any,
        weights: list[Any],
        data: tuple[Any, ...],
        recipe: StackRecipe,
        device: str,
    ) -> None:
        self._torch, self._weights, self._data = torch, weights, data
        self._largest = recipe.learning_rate
        self._on_gpu = device == "cuda"
        self._rate = torch.tensor(recipe.learning_rate, device=device)
        self._optimiser = torch.optim.AdamW(
            weights,
            lr=self._rate,
            weight_decay=recipe.weight_decay,
            foreach=False,
            fused=self._on_gpu,
            capturable=self._on_gpu,
        )
        shape = (recipe.count, recipe.batch)
        self._rows = torch.zeros(shape, dtype=torch.int64, device=device)
        self._loss: Any = torch.zeros((), device=device)
        self._graph: Any = None
        self._taken = 0

    def take(self, rows: Any, rate: float) -> Any:
        """Learn from some rows, (count, batch), and return the sum of the nets' losses."""
        self._rows.copy_(rows)
        self._rate.fill_(self._largest * rate)
        if self._graph is not None:
            self._graph.replay()
        elif self._on_gpu and self._taken == _RECORDED_AFTER:
            self._graph = self._torch.cuda.CUDAGraph()
            with self._torch.cuda.graph(self._graph):
                self._learn()
            self._graph.replay()
        else:
            self._learn()
        self._taken += 1
        return self._loss

    def _learn(self) -> None:
        torch = self._torch
        x, target, weight, truth, known = (column[self._rows] for column in self._data)
        mean_out, scale_out = _outputs(torch, self._weights, x)
        loss = torch.nn.functional.smooth_l1_loss(mean_out, target, beta=0.5, reduction="none")
        miss = (mean_out - truth).abs().detach().clamp(max=LARGEST_MISS)
        size_loss = known * (scale_out + miss * torch.exp(-scale_out))
        losses = (weight * loss).mean(dim=1).sum()
        self._optimiser.zero_grad(set_to_none=False)
        (losses + SIZE_WEIGHT * (weight * size_loss).mean(dim=1).sum()).backward()
        squares = sum(part.grad.square().flatten(1).sum(1) for part in self._weights)
        share = (LARGEST_GRADIENT / (squares.sqrt() + 1e-6)).clamp(max=1.0)
        for part in self._weights:
            part.grad.mul_(share.view(-1, 1, 1))
        self._optimiser.step()
        self._loss.copy_(losses.detach())


def _outputs(torch: Any, weights: list[Any], x: Any) -> tuple[Any, Any]:
    """Return both outputs of all nets, (count, batch) each, for inputs (count, batch, k)."""
    last = len(weights) - 2
    for i in range(0, len(weights), 2):
        x = torch.baddbmm(weights[i + 1], x, weights[i])
        if i < last:
            x = torch.nn.functional.silu(x)
    return x[..., 0], x[..., 1]


def _scales(X: NDArray[Any]) -> tuple[_Array, _Array]:
    return X.mean(axis=0, dtype=np.float64), X.std(axis=0, dtype=np.float64) + 1e-6


def _tensors(
    torch: Any, lessons: Lessons, mean: _Array, std: _Array, device: str
) -> tuple[Any, ...]:
    """Return inputs, targets, weights, truths, and which of these are known, as floats."""
    x = torch.empty(lessons.X.shape, dtype=torch.float32, device=device)
    for first in range(0, len(lessons.X), _ROWS_AT_ONCE):
        part = _scaled(lessons.X[first : first + _ROWS_AT_ONCE], mean, std)
        x[first : first + len(part)] = torch.from_numpy(part).to(device)
    known = np.isfinite(lessons.truth)
    columns = (
        lessons.target / UNIT,
        lessons.weight,
        np.where(known, lessons.truth, 0.0) / UNIT,
        known,
    )
    return x, *(torch.from_numpy(column.astype(np.float32)).to(device) for column in columns)


def _first_weights(torch: Any, recipe: StackRecipe, inputs: int, device: str) -> list[Any]:
    """Return weights (count, in, out) and biases (count, 1, out) of the layers in turn."""
    parts: list[Any] = []
    generator = torch.Generator().manual_seed(recipe.seed)
    sizes = [inputs, *[recipe.width] * recipe.layers, 2]
    for before, after in itertools.pairwise(sizes):
        # As torch.nn.Linear begins; the head smaller, without biases.
        bound = (0.1 if after == 2 else 1.0) / math.sqrt(before)
        for shape in ((recipe.count, before, after), (recipe.count, 1, after)):
            drawn = torch.rand(shape, generator=generator)
            parts.append((2.0 * drawn - 1.0) * bound)
    parts[-1].zero_()
    return [part.to(device).requires_grad_() for part in parts]


def _arrays(weights: list[Any], k: int, mean: _Array, std: _Array) -> dict[str, _Array]:
    found: dict[str, _Array] = {"mean": mean, "std": std, "unit": np.array(UNIT)}
    for i in range(0, len(weights), 2):
        found[f"weight_{i // 2}"] = weights[i][k].detach().cpu().numpy().T.copy()
        found[f"bias_{i // 2}"] = weights[i + 1][k, 0].detach().cpu().numpy().copy()
    return found
