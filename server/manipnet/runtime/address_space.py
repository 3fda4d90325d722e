"""Whether the system gives a process enough address space for a server.

Under a small limit, the libraries in C end the process in the middle of a session, and no error can be caught.
"""

import sys
from typing import Final

from manipnet.common.options import ConfigError

NEEDED_BYTES: Final = 2_000_000_000
"""A server with an open page has 2.1 GB of address space, most of it reserved by threads and never used."""


def check_address_space() -> None:
    """Raise `ConfigError` if the address space of this process is limited to less than a server needs."""
    if sys.platform == "win32":
        return
    import resource

    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY and limit < NEEDED_BYTES:
        raise ConfigError(
            f"the address space of this process is limited to {limit / 1e9:.1f} GB, and the server needs at least "
            f"{NEEDED_BYTES / 1e9:.0f} GB; lift the limit with `ulimit -v unlimited` before the start"
        )
