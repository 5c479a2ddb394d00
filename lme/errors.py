"""The one exception that means: the user can fix this."""


class InputError(ValueError):
    """A mistake in what was given: a config value, a file, a path.

    The message is one line that names the file or key, the value, and what would be right.
    The command line prints it alone, without a traceback, and exits with status 2.
    """
