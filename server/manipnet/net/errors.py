"""Why the server cannot listen."""


class ListenError(OSError):
    """A socket cannot listen where it was told to. The text names the address, the reason and the remedy."""


def cannot_listen(address: str, reason: object) -> ListenError:
    """The error of a socket that cannot be bound to `address`, for the `reason` that the system gives."""
    return ListenError(
        f"cannot listen on {address}: {reason}; "
        "choose a port that is free (0 stands for any free port) and an address of this machine"
    )
