"""Compiles the kernels while the program is built, so that an installation need not do so at its first start."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class KernelHook(BuildHookInterface):
    """Runs `manipnet.runtime.precompile`; pyproject.toml has the program's requirements installed beside hatchling."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile for this interpreter and this kind of computer, unless these very sources were compiled before.

        A wheel without kernels works too, so a failure is reported and does no harm.
        """
        package = Path(self.root, "server")
        kernels = package / "manipnet" / "kernels"
        with tempfile.TemporaryDirectory(prefix="manipnet-build-") as cache:
            # an isolated build finds its libraries by the path of this interpreter only
            path = os.pathsep.join([str(package), *filter(None, sys.path)])
            result = subprocess.run(
                [sys.executable, "-m", "manipnet.runtime.precompile", "--into", str(kernels)],
                env=os.environ | {"PYTHONPATH": path, "MANIPNET_CACHE": cache},
                capture_output=True,
                text=True,
                check=False,
            )
        if result.returncode:
            self.app.display_warning(f"no compiled kernels are brought along: {result.stderr.strip()}")
