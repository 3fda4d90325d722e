"""A small Motive for tests, which answers the requests of a NatNet client and streams frames to it over loopback.

`python tests/support/fake_motive.py traffic.pcapng --port 1510` plays a capture at 120 Hz, over and over.
"""

import argparse
import itertools
import socket
import struct
import threading
import time
from pathlib import Path

from natnet_writer import definitions, packet, server_info

CLOCK_HZ = 1_000_000
CLIENT_TIMEOUT_S = 10.0


class FakeMotive:
    """Listens on a free loopback port. `send` streams one frame payload to whoever is connected.

    `requests` counts what clients asked, by message id; `wait_for(id, n)` waits until it was asked n times.
    """

    def __init__(self, version=(3, 0), names=None, *, port=0, group=None, data_port=1511, info=None, models=None):
        self.version = version
        self.info = info or server_info(version, CLOCK_HZ, data_port, group)
        self.models = models
        self.skeletons: dict[int, tuple[str, dict[int, str]]] | None = None
        self.names = {} if names is None else names
        self.clock_offset_s = 5_000.0
        self.requests = {}
        self.clients = {}
        self.group = (group, data_port) if group else None
        self._news = threading.Condition()
        self._commands = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._commands.bind(("127.0.0.1", port))
        self._data = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # frames leave from another port
        self._data.bind(("127.0.0.1", 0))
        if group:
            self._data.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self.port = self._commands.getsockname()[1]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()

    def close(self):
        self._commands.sendto(b"stop", ("127.0.0.1", self.port))
        self._thread.join()
        self._commands.close()
        self._data.close()

    def send(self, payload, message_id=7):
        """Stream one payload to every client, or to the multicast group."""
        targets = [self.group] if self.group else list(self.clients)
        for target in targets:
            self._data.sendto(packet(message_id, payload), target)

    def wait_for(self, message_id, count=1):
        with self._news:
            enough = self._news.wait_for(lambda: self.requests.get(message_id, 0) >= count, timeout=20)
        assert enough, f"message {message_id} was asked {self.requests.get(message_id, 0)} times, not {count}"

    def _serve(self):
        while True:
            request, client = self._commands.recvfrom(65_536)
            if request == b"stop":
                return
            message_id = struct.unpack_from("<H", request)[0]
            answer = self._answer(message_id, request[4:])
            with self._news:
                if message_id in (0, 10):
                    self.clients[client] = time.monotonic()
                for silent in [c for c, t in self.clients.items() if time.monotonic() - t > CLIENT_TIMEOUT_S]:
                    del self.clients[silent]
                if answer is not None:
                    self._commands.sendto(answer, client)
                self.requests[message_id] = self.requests.get(message_id, 0) + 1
                self._news.notify_all()

    def _answer(self, message_id, payload):
        match message_id:
            case 0 | 14:
                return packet(1, self.info)
            case 4:
                return packet(5, self.models or definitions(self.names, self.version, self.skeletons))
            case 12:
                ticks = int((time.monotonic() + self.clock_offset_s) * CLOCK_HZ)
                return packet(13, payload[:8] + struct.pack("<Q", ticks))
            case 10 | 9:
                return None
        return packet(100)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("capture", type=Path, help="traffic.pcapng")
    parser.add_argument("--port", type=int, default=1510)
    options = parser.parse_args()
    import natnet_capture

    datagrams = list(natnet_capture.datagrams(options.capture.parent))
    payloads = {d.data[0]: d.data[4:] for d in datagrams}
    frames = [d.data[4:] for d in datagrams if d.data[:2] == b"\x07\0"]
    with FakeMotive(port=options.port, info=payloads[1], models=payloads[5]) as motive:
        print(f"ready 127.0.0.1:{motive.port}", flush=True)
        start = time.monotonic()
        for n, frame in enumerate(itertools.cycle(frames)):
            time.sleep(max(0.0, start + n / 120 - time.monotonic()))
            motive.send(frame)


if __name__ == "__main__":
    main()
