"""Own object: make a mesh, give it to a running server, and let a body carry it.

    python -m pip install ./clients/python
    manipnet-serve --demo
    python examples/own_object.py [cube [tcp://127.0.0.1:5557]]

The first argument is the body; in the demo it is cube, cylinder or mug. Any closed OBJ, PLY, STL or GLB file will do. A
server on another machine does not accept files; it reads them from its folder `--objects`.
"""

import sys
import tempfile
from pathlib import Path

import trimesh
from manipnet_client import ControlClient


def main(body: str = "cube", control: str = "tcp://127.0.0.1:5557") -> None:
    """Let the body carry a ring."""
    server = ControlClient(control)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ring.ply"
        ring = trimesh.creation.annulus(r_min=0.02, r_max=0.04, height=0.03)  # metres
        ring.export(file)
        name = server.ask("add_object", file=str(file), unit="m")["object"]
    answer = server.ask("select_object", body=body, object=name)
    print(f"{body} carries {name} from message {answer['seq']} on")


if __name__ == "__main__":
    main(*sys.argv[1:])
