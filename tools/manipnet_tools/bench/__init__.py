"""`manipnet bench`: what a tick costs, stage by stage, beside a reference measured in the same run."""

from manipnet_tools.bench.command import main

__all__ = ["main"]
