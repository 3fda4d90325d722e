"""Keys of ZeroMQ connections: CURVE encryption, and a list of allowed clients, checked at each handshake (ZAP).

CURVE alone would let in every client that knows the server's public key. Without keys, the same check keeps out old
peers, whose messages could not be told from what a web page sends.
"""

import logging

import zmq
from zmq.utils import z85

from manipnet.net.curve_keys import ClientKeys, KeyFileError, ServerKeys, read_allow_list

ZAP_ADDRESS = "inproc://zeromq.zap.01"  # fixed by ZeroMQ's RFC 27
DOMAIN = b"manipnet"
_log = logging.getLogger(__name__)


def open_door(request: list[bytes]) -> tuple[list[bytes], bool]:
    """The reply where no keys are required, and whether it lets in: any client of ZMTP 3.

    ZeroMQ itself refuses the peers of ZMTP 1.0 and 2.0 wherever somebody answers such requests. It must, since anything
    that is not ZeroMQ, such as a request of a web page, is read as ZMTP 1.0.
    """
    version, request_id, domain, _, _, mechanism, *_ = request
    if domain == DOMAIN and mechanism == b"NULL":
        return [version, request_id, b"200", b"OK", b"", b""], True
    return [version, request_id, b"400", b"no keys here", b"", b""], False


class ClientList:
    """The clients on the list of `keys`, which is read again when it has changed."""

    def __init__(self, keys: ServerKeys) -> None:
        """Raises `KeyFileError` if the list cannot be read."""
        read_allow_list(keys.allow_file)
        self._file = keys.allow_file
        self._listed: dict[str, str] = {}
        self._stamp: tuple[int, int] | None = None

    def answer(self, request: list[bytes]) -> tuple[list[bytes], bool]:
        """The reply of RFC 27, `[version, request id, status, text, user id, metadata]`, and whether it lets in."""
        version, request_id, domain, _, _, mechanism, *credentials = request
        name = None
        if domain == DOMAIN and mechanism == b"CURVE" and len(credentials) == 1:
            name = self._names().get(z85.encode(credentials[0]).decode("ascii"))
        if name is None:
            return [version, request_id, b"400", b"not on the list", b"", b""], False
        return [version, request_id, b"200", b"OK", name.encode("ascii"), b""], True

    def _names(self) -> dict[str, str]:
        """The list as it is now. If it cannot be read, nobody may connect."""
        try:
            status = self._file.stat()
            stamp = (status.st_mtime_ns, status.st_size)
            if stamp != self._stamp:
                self._listed, self._stamp = read_allow_list(self._file), stamp
        except (OSError, KeyFileError) as error:
            self._listed, self._stamp = {}, None
            _log.error("nobody can connect: %s", error)
        return self._listed


def secure_server(socket: zmq.Socket, keys: ServerKeys) -> None:
    """Give a server's socket its keys. Call this before it is bound."""
    socket.setsockopt(zmq.CURVE_SERVER, 1)
    socket.setsockopt_string(zmq.CURVE_PUBLICKEY, keys.pair.public)
    socket.setsockopt_string(zmq.CURVE_SECRETKEY, keys.pair.secret)


def secure_client(socket: zmq.Socket, keys: ClientKeys) -> None:
    """Give a client's socket its keys. Call this before it connects."""
    socket.setsockopt_string(zmq.CURVE_PUBLICKEY, keys.pair.public)
    socket.setsockopt_string(zmq.CURVE_SECRETKEY, keys.pair.secret)
    socket.setsockopt_string(zmq.CURVE_SERVERKEY, keys.server_public)
