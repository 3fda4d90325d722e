"""Child processes give way to the ticks from their first instruction on."""

import os
import sys
from multiprocessing.connection import Connection

import pytest

from manipnet.runtime.child_process import NICE, ChildProcess


def tell_priority(connection: Connection, _: bytes) -> None:
    connection.send_bytes(str(os.getpriority(os.PRIO_PROCESS, 0)).encode())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has classes of priority instead")
def test_a_child_has_a_lower_priority_and_the_server_keeps_its_own() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    child = ChildProcess("test", tell_priority, bytes(1 << 20))
    assert child.connection.poll(120.0)
    assert int(child.connection.recv_bytes()) == min(before + NICE, 19)
    child.close()
    assert os.getpriority(os.PRIO_PROCESS, 0) == before
