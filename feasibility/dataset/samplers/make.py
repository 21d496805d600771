"""The samplers that a protocol's TOML file knows by name."""

from feasibility.dataset.samplers.any_spacecraft import AnySpacecraft
from feasibility.dataset.samplers.random_pairs import RandomPairs
from feasibility.dataset.samplers.search_candidates import SearchCandidates
from feasibility.dataset.samplers.transfers import Transfers

NamedSampler = RandomPairs | SearchCandidates | AnySpacecraft | Transfers
"""What ``kind`` in the table ``[sampler]`` chooses from, each by its struct's tag."""
