"""The paper's network: fully connected, two outputs, cross-entropy, Adam with a stepwise rate."""

import itertools
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Self, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.predictors import LEAKY_SLOPE
from feasibility.errors import InputError
from feasibility.learning.paper.models.base import (
    Epoch,
    Fitted,
    OnEpoch,
    check_training_data,
)
from feasibility.learning.paper.models.precision import PRECISIONS, resolve_precision
from feasibility.learning.training_loop import (
    Checkpoint,
    Learner,
    LoopRule,
    train_network,
    training_identity,
)
from feasibility.runtime.extras import load_extra

ACTIVATIONS: Final = ("relu", "leaky_relu", "elu")
_ADAM_EPSILON: Final = 1e-8
_VALIDATION_BATCH: Final = 8192
_NOT_OF_THE_TRAINING: Final = ("epochs", "patience", "device", "threads", "precision")
"""Hyperparameters that may change between an interrupted training and its continuation."""


@final
@dataclass(frozen=True)
class DnnConfig:
    """Hyperparameters of `Dnn`; the first nine are those of Table 3.

    Parameters
    ----------
    layers : int
        Hidden layers, L.
    width : int
        Neurons in each of them.
    activation : str
        "relu", "leaky_relu" or "elu".
    beta1, beta2 : float
        Decay rates of Adam's moments.
    batch : int
        Rows of a step.
    learning_rate : float
        At the first epoch.
    drop_period : int
        T_drop: the rate falls each time this many epochs have passed ...
    drop_factor : float
        ... by this factor, d.
    epochs : int
        How many at most; by default the rate has then fallen three times for DNN1.
    patience : int, optional
        Stop early, when the validation loss has not fallen for this many epochs.
    keep_best : bool
        Keep the weights of the lowest validation loss instead of the last ones. With neither,
        as in the paper, validation rows are only reported on.
    device : str
        "cpu", "cuda", or "auto" for a GPU where there is one.
    threads : int
        Threads of the processor.
    precision : str
        Number format of the training's matrix products: "float32", "bfloat16",
        or "auto" for bfloat16 where processor or GPU have it, see `precision`.
        Weights and predictions are float32 in any case.
    """

    layers: int = 9
    width: int = 440
    activation: str = "leaky_relu"
    beta1: float = 0.9041
    beta2: float = 0.9540
    batch: int = 500
    learning_rate: float = 0.0031
    drop_period: int = 6
    drop_factor: float = 0.1720
    epochs: int = 24
    patience: int | None = None
    keep_best: bool = False
    device: str = "cpu"
    threads: int = 2
    precision: str = "auto"

    def __post_init__(self) -> None:
        if self.activation not in ACTIVATIONS:
            raise InputError(
                f"dnn activation: {self.activation!r}, expected one of {', '.join(ACTIVATIONS)}"
            )
        if self.precision not in PRECISIONS:
            raise InputError(
                f"dnn precision: {self.precision!r}, expected one of {', '.join(PRECISIONS)}"
            )
        for name in ("layers", "width", "batch", "drop_period", "epochs", "threads"):
            if getattr(self, name) < 1:
                raise InputError(f"dnn {name}: {getattr(self, name)}, expected 1 or more")
        if not self.learning_rate > 0:
            raise InputError(f"dnn learning_rate: {self.learning_rate}, expected more than 0")

    def rate(self, epoch: int) -> float:
        """Return the learning rate of an epoch, counted from 1."""
        return float(self.learning_rate * self.drop_factor ** ((epoch - 1) // self.drop_period))


@final
class Dnn(Fitted):
    """A fully connected network in torch; the same seed gives the same weights on one machine."""

    kind = "dnn"

    def __init__(self, **hyperparameters: Any) -> None:
        super().__init__()
        self._config = DnnConfig(**hyperparameters)
        self._history: tuple[Epoch, ...] = ()

    @property
    def config(self) -> dict[str, Any]:
        """Hyperparameters; once fitted, `precision` is the one that was used."""
        return asdict(self._config)

    @property
    def history(self) -> tuple[Epoch, ...]:
        """All epochs of the training, those before an interruption too."""
        return self._history

    def fit(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.bool_],
        *,
        rng: np.random.Generator,
        X_val: NDArray[np.float64] | None = None,
        y_val: NDArray[np.bool_] | None = None,
        on_epoch: OnEpoch | None = None,
        checkpoint: Path | None = None,
    ) -> Self:
        """Learn; see `Model.fit`.

        Parameters
        ----------
        checkpoint : Path, optional
            File rewritten after each epoch; training goes on from it where it
            exists, and ends with the weights of an uninterrupted training.

        Raises
        ------
        InputError
            Also: the checkpoint belongs to another training.
        """
        check_training_data(X, y)
        torch = load_extra("torch")
        device = find_device(torch, self._config.device)
        self._config = replace(
            self._config, precision=resolve_precision(torch, self._config.precision, device)
        )
        config = self._config
        judged = config.patience is not None or config.keep_best
        if judged and (y_val is None or not len(y_val)):
            raise InputError("dnn patience, keep_best: they need validation rows, got none")
        torch.set_num_threads(config.threads)
        seed = int(rng.integers(2**31))

        network = _network(torch, config, X.shape[1], seed).to(device)
        optimiser = torch.optim.Adam(
            network.parameters(),
            lr=config.learning_rate,
            betas=(config.beta1, config.beta2),
            eps=_ADAM_EPSILON,
            fused=True,
        )
        validation = None
        if X_val is not None and y_val is not None and len(y_val):
            validation = _tensors(torch, X_val, y_val, device)
        epochs = _Epochs(
            config, network, optimiser, _tensors(torch, X, y, device), validation, seed, device
        )
        self._history = train_network(
            Learner(network, optimiser, epochs.train, Epoch),
            LoopRule(config.epochs, config.patience, config.keep_best),
            checkpoint=Checkpoint.at(checkpoint, lambda: _identity(config, X, y, seed)),
            on_epoch=on_epoch or (lambda _: None),
        )
        self._keep(_arrays(network, config))
        return self


@final
@dataclass(frozen=True, eq=False)
class _Epochs:
    """What an epoch of a network is; n training rows."""

    config: DnnConfig
    network: Any
    optimiser: Any
    rows: tuple[Any, Any]
    validation: tuple[Any, Any] | None
    seed: int
    device: str

    def train(self, number: int) -> Epoch:
        """Train for one epoch and return its record."""
        torch, config = load_extra("torch"), self.config
        began = time.perf_counter()
        for group in self.optimiser.param_groups:
            group["lr"] = config.rate(number)
        rounded = torch.autocast(
            self.device, dtype=torch.bfloat16, enabled=config.precision == "bfloat16"
        )
        n = len(self.rows[1])
        loss, right = self._learn(torch, number, rounded)
        with rounded:
            val_loss, val_accuracy = _validate(torch, self.network, self.validation)
        return Epoch(
            number,
            config.rate(number),
            loss / n,
            right / n,
            val_loss,
            val_accuracy,
            time.perf_counter() - began,
        )

    def _learn(self, torch: Any, number: int, rounded: Any) -> tuple[float, float]:
        """Take the steps of one epoch; return the sums of losses and of right answers."""
        inputs, labels = self.rows
        n = len(labels)
        # Seeded by the epoch, so that a resumed training shuffles as an uninterrupted one.
        shuffle = torch.Generator().manual_seed((self.seed + 7919 * number) % 2**31)
        order = torch.randperm(n, generator=shuffle).to(self.device)
        total_loss = torch.zeros((), device=self.device)
        right = torch.zeros((), device=self.device)
        self.network.train()
        # A last batch of a few rows would make a wild step: it is shared among the others.
        for rows in torch.tensor_split(order, max(1, round(n / self.config.batch))):
            with rounded:
                logits = self.network(inputs[rows])
                loss = torch.nn.functional.cross_entropy(logits, labels[rows])
            self.optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self.optimiser.step()
            total_loss += loss.detach() * len(rows)
            right += (logits.detach().argmax(dim=1) == labels[rows]).sum()
        return float(total_loss), float(right)


def _tensors(
    torch: Any, X: NDArray[np.float64], y: NDArray[np.bool_], device: str
) -> tuple[Any, Any]:
    return (
        torch.as_tensor(X, dtype=torch.float32, device=device),
        torch.as_tensor(y, dtype=torch.int64, device=device),
    )


def _identity(config: DnnConfig, X: NDArray[np.float64], y: NDArray[np.bool_], seed: int) -> str:
    """Return the identity of a training, which may last longer or go on elsewhere."""
    settings = {
        name: value for name, value in asdict(config).items() if name not in _NOT_OF_THE_TRAINING
    }
    return training_identity({**settings, "seed": seed}, X, y)


def _network(torch: Any, config: DnnConfig, n_features: int, seed: int) -> Any:
    """Return the network with weights drawn as He et al. 2015 do (Kaiming normal), biases 0."""
    activations = {
        "relu": torch.nn.ReLU,
        "leaky_relu": lambda: torch.nn.LeakyReLU(LEAKY_SLOPE),
        "elu": torch.nn.ELU,
    }
    generator = torch.Generator().manual_seed(seed)
    sizes = [n_features, *[config.width] * config.layers, 2]
    parts: list[Any] = []
    for n_in, n_out in itertools.pairwise(sizes):
        linear = torch.nn.Linear(n_in, n_out)
        torch.nn.init.kaiming_normal_(linear.weight, nonlinearity="relu", generator=generator)
        torch.nn.init.zeros_(linear.bias)
        parts += [linear, activations[config.activation]()]
    return torch.nn.Sequential(*parts[:-1])


def _validate(torch: Any, network: Any, validation: tuple[Any, Any] | None) -> tuple[float, float]:
    """Return mean cross-entropy and accuracy on the validation rows, NaN without them."""
    if validation is None:
        return float("nan"), float("nan")
    inputs, labels = validation
    network.eval()
    loss = right = 0.0
    with torch.no_grad():
        for first in range(0, len(labels), _VALIDATION_BATCH):
            part = slice(first, first + _VALIDATION_BATCH)
            logits = network(inputs[part])
            loss += float(torch.nn.functional.cross_entropy(logits, labels[part], reduction="sum"))
            right += float((logits.argmax(dim=1) == labels[part]).sum())
    return loss / len(labels), right / len(labels)


def _arrays(network: Any, config: DnnConfig) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {"activation": np.array(config.activation)}
    linear = [part for part in network if hasattr(part, "weight")]
    for i, part in enumerate(linear):
        arrays[f"weight_{i}"] = part.weight.detach().cpu().numpy().copy()
        arrays[f"bias_{i}"] = part.bias.detach().cpu().numpy().copy()
    return arrays


def find_device(torch: Any, name: str) -> str:
    """Return "cpu" or "cuda" for one of these or "auto".

    Raises
    ------
    InputError
        Another name, or there is no GPU.
    """
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    if name == "cuda" and not torch.cuda.is_available():
        raise InputError("dnn device: cuda, but torch finds no GPU; expected cpu or auto")
    if name not in ("cpu", "cuda"):
        raise InputError(f"dnn device: {name!r}, expected cpu, cuda or auto")
    return name
