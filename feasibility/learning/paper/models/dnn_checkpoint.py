"""State of a network's training between epochs, and its file."""

import hashlib
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.learning.paper.models.base import Epoch
from feasibility.runtime.atomic import atomic_path


@final
class TrainingState:
    """Network, optimiser and the best weights so far.

    Attributes
    ----------
    identity : str
        Digest of data, seed and hyperparameters: only the same training goes on.
    epoch : int
        The last one done, 0 before the first.
    best_epoch : int
        The one with the lowest validation loss, 0 without validation.
    best_weights : dict
        Weights to keep, of that epoch or of the last one.
    history : list of Epoch
        All epochs done, those before an interruption too.
    """

    def __init__(self, network: Any, optimiser: Any, identity: str) -> None:
        self.network = network
        self.optimiser = optimiser
        self.identity = identity
        self.epoch = 0
        self.best_epoch = 0
        self.best_loss = math.inf
        self.best_weights = _copy(network)
        self.history: list[Epoch] = []

    def record(self, epoch: Epoch, *, keep_best: bool) -> None:
        """Take note of an epoch: the best so far, or simply the last one."""
        self.epoch = epoch.number
        self.history.append(epoch)
        better = epoch.validation_loss < self.best_loss
        if better:
            self.best_epoch = epoch.number
            self.best_loss = epoch.validation_loss
        if better or not keep_best:
            self.best_weights = _copy(self.network)

    def save(self, torch: Any, path: Path) -> None:
        """Write everything to a file, which is complete or absent."""
        content = {
            "identity": self.identity,
            "epoch": self.epoch,
            "best_epoch": self.best_epoch,
            "best_loss": self.best_loss,
            "best_weights": self.best_weights,
            "history": [asdict(epoch) for epoch in self.history],
            "network": self.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
        }
        with atomic_path(path) as temporary:
            torch.save(content, temporary)

    def load(self, torch: Any, path: Path) -> None:
        """Go on from a file.

        Raises
        ------
        InputError
            The file is damaged, or belongs to another training.
        """
        try:
            content = torch.load(path, weights_only=True, map_location="cpu")
            identity = content["identity"]
        except Exception as error:  # torch raises whatever its readers do
            raise InputError(
                f"{path}: not a checkpoint of this program, or damaged "
                f"({type(error).__name__}); delete it to start again"
            ) from None
        if identity != self.identity:
            raise InputError(
                f"{path}: checkpoint of another training (data, seed or hyperparameters differ); "
                "expected the same, or another file"
            )
        self.network.load_state_dict(content["network"])
        self.optimiser.load_state_dict(content["optimiser"])
        self.epoch = content["epoch"]
        self.best_epoch = content["best_epoch"]
        self.best_loss = content["best_loss"]
        self.best_weights = content["best_weights"]
        self.history = [Epoch(**epoch) for epoch in content["history"]]


def training_identity(
    config: dict[str, Any], X: NDArray[np.float64], y: NDArray[np.bool_], seed: int
) -> str:
    """Return a digest of all that decides what a training gives, but the number of epochs."""
    settings = {
        name: value
        for name, value in config.items()
        if name not in ("epochs", "patience", "device", "threads", "precision")
    }
    digest = hashlib.sha256(json.dumps([settings, seed], sort_keys=True).encode())
    digest.update(np.ascontiguousarray(X).data)
    digest.update(np.ascontiguousarray(y).data)
    return digest.hexdigest()


def _copy(network: Any) -> dict[str, Any]:
    return {name: value.detach().clone() for name, value in network.state_dict().items()}
