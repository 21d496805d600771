"""`run_carrier`: a mother ship and her probes, in one run folder with a sub-folder a probe."""

from pathlib import Path
from typing import Final

from feasibility import InputError
from feasibility.orbits import Catalogue
from feasibility.runtime.atomic import remove_stale, write_json, write_text
from feasibility.runtime.cluster import crew as workers_of
from feasibility.runtime.folders import new_folder
from feasibility.runtime.interrupts import interrupt_code
from feasibility.runtime.locks import folder_lock
from feasibility.runtime.provenance import provenance
from feasibility.runtime.terminal import Level, say
from feasibility.runtime.workers import default_workers
from seqsearch.budget import Limits
from seqsearch.carriers.campaign import Campaign, CampaignSettings, launches_of
from seqsearch.carriers.crew import Crew
from seqsearch.carriers.flight import carrier_of
from seqsearch.carriers.plans import Screen
from seqsearch.carriers.probe_tours import probe_config, probe_tour
from seqsearch.carriers.state_files import CampaignState, read_state, write_state
from seqsearch.problems.problem_file import (
    Config,
    build_problem,
    read_config,
    to_toml,
    whole_catalogue,
    with_catalogue,
)
from seqsearch.problems.registry import carrier_rules
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.pruning.pruner_spec import parse_pruner, predictor_of
from seqsearch.runs.carriers import is_carrier_run
from seqsearch.runs.checkpoint import catalogue_digest
from seqsearch.runs.fleet import probe_folder, write_fleet
from seqsearch.runs.run_folder import CONFIG, CSV, PROVENANCE, SEQUENCE, portable
from seqsearch.runs.session import PACKAGES
from seqsearch.tours.carrier.carrier_files import CARRIER, write_carrier
from seqsearch.tours.tour_files import to_csv, to_json

CHART: Final = "chart"
"""Name of the folder with the chart of all legs. It can be deleted; it is made anew."""

_WHOLE_WINDOW_S: Final = 1800.0
_LEAST_SHARE: Final = 0.2
"""Time limit from which on the whole launch window is looked at, and the share of it that is
looked at in any case."""

STATE: Final = "carrier-state.json"
"""Name of the file that a carrier's run goes on from."""


def begin_carrier(
    config: Config,
    path: Path,
    seed: int,
    limits: Limits,
    settings: CampaignSettings | None = None,
) -> int:
    """Make a run folder, search for a carrier's flight and the tours of its craft.

    Without a time limit the same seed and settings give the same result.

    Returns
    -------
    int
        The exit code: 0, or 130 or 143 after Ctrl-C or SIGTERM.

    Raises
    ------
    InputError
        Anything in the configuration that cannot be used, or the folder exists.
    """
    catalogue = whole_catalogue(config)
    problem = _problem(config, catalogue)
    new_folder(path)
    write_text(path / CONFIG, to_toml(portable(config, path)))
    write_json(path / PROVENANCE, provenance() | {"seed": seed})
    with folder_lock(path):
        say(
            f"{config.problem.name}: {len(catalogue)} bodies from {catalogue.source}, "
            f"seed {seed}, writing to {path}",
            Level.PROGRESS,
        )
        state = CampaignState(seed=seed, limit_s=limits.time_limit_s)
        state.catalogue_sha256 = catalogue_digest(catalogue)
        if limits.time_limit_s is not None:
            least = limits.time_limit_s / _WHOLE_WINDOW_S
            state.launch_share = min(max(least, _LEAST_SHARE), 1.0)
        if settings is not None:
            state.launch_share = settings.launch_share
        return _run(path, config, problem, state, limits, settings)


def is_carrier_search(path: Path) -> bool:
    """Tell whether a folder holds the run of a carrier, which can be resumed."""
    return (path / STATE).is_file()


def resume_carrier(
    path: Path,
    limits: Limits,
    catalogue: str | None,
    settings: CampaignSettings | None = None,
) -> int:
    """Go on with the run of a carrier and return the exit code; settings are those it began with.

    Raises
    ------
    InputError
        The folder is damaged or in use, the asteroid table is another one, or the time is used up.
    """
    with folder_lock(path):
        for folder in (path, *filter(Path.is_dir, path.iterdir())):
            remove_stale(folder)
        config = read_config(str(path / CONFIG))
        if catalogue is not None:
            config = with_catalogue(config, catalogue)
        problem = _problem(config, whole_catalogue(config))
        state = read_state(path / STATE, problem)
        if state.catalogue_sha256 != catalogue_digest(problem.catalogue):
            raise InputError(
                f"{problem.catalogue.source}: not the asteroid table that {path} was begun with"
            )
        if limits.time_limit_s is not None:
            state.limit_s = limits.time_limit_s
        if state.limit_s is not None and state.limit_s <= state.spent_s:
            raise InputError(
                f"{path}: has spent {state.spent_s:.0f} s of {state.limit_s:.0f} s; "
                "expected a larger --time-limit"
            )
        say(f"{config.problem.name}: going on in {path} after {state.spent_s:.0f} s")
        return _run(path, config, problem, state, limits, settings)


def _problem(config: Config, catalogue: Catalogue) -> RendezvousProblem:
    problem = build_problem(config, catalogue)
    if not isinstance(problem, RendezvousProblem):
        raise InputError(f"problem {config.problem.name}: a carrier's probes fly rendezvous alone")
    return problem


def _run(
    path: Path,
    config: Config,
    problem: RendezvousProblem,
    state: CampaignState,
    limits: Limits,
    settings: CampaignSettings | None = None,
) -> int:
    predictor = predictor_of(parse_pruner(config.search.pruner))
    if predictor is None:
        raise InputError(f"pruner {config.search.pruner}: expected one with a trained model")
    rules = carrier_rules(config.problem.name)
    launches = launches_of(rules, state)
    screen = Screen(problem, rules, predictor, config.search, path / CHART, launches)
    written: list[Crew] = []
    workers = limits.workers or default_workers()

    def on_step(state: CampaignState, line: str) -> None:
        write_state(path / STATE, state, problem)
        if state.crews and state.crews[0] not in written:
            written[:] = state.crews[:1]
            write_crew(path, config, screen, state.crews[0], state.seed)
        say(f"{state.spent_s:7.0f} s  {line}", Level.PROGRESS)

    try:
        with workers_of(workers, limits.scheduler, PACKAGES) as executor:
            campaign = Campaign(
                screen,
                problem,
                settings=settings or CampaignSettings(),
                executor=executor,
                workers=workers,
                on_step=on_step,
            )
            campaign.run(state)
    except KeyboardInterrupt:
        say(f"interrupted; go on with: seqsearch resume {path}")
    if is_carrier_run(path) and state.crews:
        best = state.crews[0]
        say(f"{best.visits()} asteroids, {best.mass_kg():.3f} kg left on the probes")
        say(f"check the probes' tours with: seqsearch verify {path}", Level.PROGRESS)
    else:
        say("no mother ship and crew found yet; give more time")
    return interrupt_code()


def write_crew(path: Path, config: Config, screen: Screen, crew: Crew, seed: int) -> None:
    """Write a mother ship's flight and the tours of her probes into a run folder.

    Raises
    ------
    InputError
        A file cannot be written, or she cannot fly.
    """
    carrier = carrier_of(screen, crew)
    if carrier is None:
        raise InputError(f"{path}: no mother ship can serve these probes")
    tours = []
    for number in range(len(crew.flights)):
        own = probe_config(config, screen.catalogue, crew, number)
        tour = probe_tour(own, screen.catalogue, crew, number)
        folder = path / probe_folder(number + 1)
        folder.mkdir(exist_ok=True)
        write_text(folder / CONFIG, to_toml(portable(own, folder)))
        write_text(folder / SEQUENCE, to_json(tour))
        write_text(folder / CSV, to_csv(tour))
        tours.append(tour)
    write_carrier(carrier, path / CARRIER)
    write_fleet(path, tours, len(tours), seed)
