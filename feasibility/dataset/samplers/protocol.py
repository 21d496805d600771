"""`Sampler`: what draws the legs of a dataset; the built-in ones are beside this file."""

from typing import Protocol

from numpy.random import Generator

from feasibility.dataset.samplers.draws import Draw
from feasibility.dataset.samplers.impulsive import ImpulsiveGrid
from feasibility.legs import Spacecraft
from feasibility.orbits import Catalogue


class Sampler(Protocol):
    """Draws legs from some distribution.

    A sampler is a frozen dataclass or msgspec struct whose fields are its settings: they are
    written to the dataset's metadata, and a dataset is resumed by an equal sampler only. Worker
    processes get it pickled, so that its class has to stand in a module. Make a dataset of your
    own sampler with ``Protocol(name="mine", sampler=..., spacecraft=...)`` and
    `feasibility.dataset.begin`.
    """

    @property
    def m0_kg(self) -> tuple[float, float]:
        """Least and largest initial mass that it draws, kg."""
        ...

    @property
    def draws_spacecraft(self) -> bool:
        """Whether each leg has a spacecraft of its own; otherwise the protocol names one."""
        ...

    def draw(
        self,
        n: int,
        rng: Generator,
        catalogue: Catalogue,
        spacecraft: Spacecraft | None,
        grid: ImpulsiveGrid,
    ) -> Draw:
        """Draw legs.

        Parameters
        ----------
        n : int
            How many, one or more; exactly as many come back.
        rng : numpy.random.Generator
            The only source of chance: the same state gives the same legs.
        catalogue : Catalogue
            The bodies.
        spacecraft : Spacecraft, optional
            The one spacecraft; None where the sampler draws its own.
        grid : ImpulsiveGrid
            Finds dt_imp, if the sampler wants it.

        Returns
        -------
        Draw
            Legs with epochs (`t_dep_mjd2000`) and ids, -1 for a body that is not in the catalogue.

        Raises
        ------
        InputError
            The catalogue or the settings do not allow `n` legs.
        """
        ...
