"""What goes wrong when a server begins to listen."""


class ListenError(OSError):
    """A receiver cannot listen where it was told to; the text names the address and the way out."""
