"""Where the bodies of a tour are, where that does not follow from their elements."""
