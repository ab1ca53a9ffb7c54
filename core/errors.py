"""What the engine raises on purpose. Each message says what is wrong, where, and what to do."""


class StrandlineError(Exception):
    """Root of the errors whose text is meant for the user; anything else that escapes is a bug."""


class InputError(StrandlineError):
    """A file, layer or parameter cannot be used as given."""


class NotEnoughData(StrandlineError):
    """The input is sound but does not determine the result."""


class MissingDependency(StrandlineError):
    """A library or program that the requested work needs is not installed."""


class Cancelled(Exception):
    """The user asked to stop."""
