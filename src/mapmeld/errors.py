"""The one root of every error that mapmeld raises on purpose."""


class MapmeldError(Exception):
    """Something a user can mend: a bad file, a bad setting, a missing extra.

    The message is one line that names what is wrong and what to do. The command line
    turns it into that line and exit code 2; each module raises a subclass of its own.
    """
