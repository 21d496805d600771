"""The errors that users meet."""

from typing import final


@final
class InputError(ValueError):
    """Input that cannot be used: a table, a TOML file, an option or an array.

    The message is one line that names the file, row or key and says what was
    expected. Both command lines print it and exit with code 2.
    """


@final
class MissingDependencyError(ImportError):
    """A package that this call needs is absent or unusable; the message says how to get it."""
