"""Fetching bodies from the services that publish them, into files that the readers read."""
