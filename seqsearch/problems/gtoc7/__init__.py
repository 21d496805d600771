"""GTOC7: main-belt asteroids by one probe or a fleet, without the mother ship or with her."""

from typing import Final

from seqsearch.tours.carrier.records import CarrierRules


def _carrier_rules() -> CarrierRules:
    # Imported here: reading any problem file looks at the rules of all problems.
    from seqsearch.problems.gtoc7.rules import carrier_rules

    return carrier_rules()


CARRIERS: Final = {"gtoc7-full": _carrier_rules}
