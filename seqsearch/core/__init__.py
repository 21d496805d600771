"""The words of the search: problem, nodes, hops, candidates, tree and full optimisation."""
