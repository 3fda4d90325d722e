"""Names of files that not every system can have."""

import os
import re
from pathlib import Path
from typing import Final

_DEVICES: Final = re.compile(r"(con|prn|aux|nul|com[\d¹²³]|lpt[\d¹²³])( *\..*)?", re.IGNORECASE)


def is_device(name: str) -> bool:
    """Whether a name stands for a device on Windows, as `COM1` does with any suffix."""
    return _DEVICES.fullmatch(name) is not None


def is_encodable(path: Path) -> bool:
    """Whether this system can write a path in the encoding of its file names, which may be ASCII under `LANG=C`."""
    try:
        os.fsencode(path)
    except UnicodeEncodeError:
        return False
    return True
