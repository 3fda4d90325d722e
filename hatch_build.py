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
        # an isolated build finds its libraries by the path of this interpreter only
        program = f"""
import runpy, sys
sys.path[:], sys.argv[1:] = {[str(package), *sys.path]!r}, ["--into", {str(kernels)!r}]
runpy.run_module("manipnet.runtime.precompile", run_name="__main__")
"""
        with tempfile.TemporaryDirectory(prefix="manipnet-build-") as cache:
            environment = os.environ | {"MANIPNET_CACHE": cache}
            command = [sys.executable, "-c", program]
            result = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if result.returncode:
            self.app.display_warning(f"no compiled kernels are brought along: {result.stderr.strip()}")
