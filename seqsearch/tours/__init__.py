"""What a search finds: the tour, its files, its verification and its picture."""
