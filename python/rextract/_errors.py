"""One exception for each exit code of the program, with the words of its error line."""


class RextractWarning(UserWarning):
    """What the program warns of: a seeing outside the network's training, a flux scale that is off ..."""


class Error(Exception):
    """The base of all. str() is the program's line without its name: 'tile.fits[2]: the image sums to zero; give ...'."""

    status = 1  #: exit code of the program

    def __init__(self, message, where="", hdu=None, line=None):
        super().__init__(message)
        self.where = where  #: file or image concerned, "" for none
        self.hdu = hdu  #: number of the HDU as in tile.fits[2], None for none
        self.line = line  #: of a text file, None for none


class UsageError(Error, ValueError):
    """A keyword, a column, an argument or a configuration file is wrong (exit code 2)."""

    status = 2


class InputError(Error):
    """The data given cannot be used (exit code 3)."""

    status = 3


class ResourceError(Error):
    """Memory, disk, permissions, missing programs (exit code 4)."""

    status = 4


class GateError(Error):
    """A quality gate is violated; outputs are written (exit code 5)."""

    status = 5


class GateUndecidedError(Error):
    """Too few sources to decide a quality gate; outputs are written (exit code 6)."""

    status = 6


class Interrupted(Error):
    """`stop` said so (exit code 7)."""

    status = 7


class SomeFailedError(Error):
    """Of a list of tiles not all are done (exit code 8)."""

    status = 8


class DifferentError(Error):
    """A run that was repeated gave something else (exit code 9)."""

    status = 9


class NotRestoredError(Error):
    """The image is not for the restorer that was asked for, and no other may do it (exit code 10)."""

    status = 10


BY_STATUS = {kind.status: kind for kind in (UsageError, InputError, ResourceError, GateError, GateUndecidedError, Interrupted,
                                            SomeFailedError, DifferentError, NotRestoredError)}
