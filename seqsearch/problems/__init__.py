"""Problems: one folder each, found by their entry points."""
