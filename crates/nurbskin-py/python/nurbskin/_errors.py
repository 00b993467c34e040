"""The exceptions, one for each kind of the library's errors; the texts are those of the command line."""


class Error(Exception):
    """Base of all exceptions of this package."""


class ReadError(Error, OSError):
    """A file could not be read, or does not say what its format demands; a FileNotFoundError where there is none."""


class WriteError(Error, OSError):
    """A file could not be written; nothing was left behind. A FileNotFoundError where its folder does not exist."""


class InvalidError(Error, ValueError):
    """Arguments contradict each other, or the definition of what they describe."""


class UnsupportedError(Error):
    """A legitimate wish that this version cannot fulfil."""


class NoSolutionError(Error, ArithmeticError):
    """The computation has no solution with these data and options."""


class MissingFileError(ReadError, FileNotFoundError):
    """A file to read does not exist."""


class MissingFolderError(WriteError, FileNotFoundError):
    """The folder of a file to write does not exist."""
