"""What the server refused, in words: how often, why, and how long ago."""

from collections.abc import Mapping
from typing import Any, Final

from manipnet.page.markdown import escape
from manipnet.page.state import ago

REASONS: Final = {
    "malformed": "messages that are not in the format of the protocol",
    "oversized": "messages that are too large",
    "incomplete": "frames of which a part was lost on the way",
    "unsupported": "messages of a version that is not known here",
    "not_allowed": "messages from addresses that are not allowed",
    "rate": "messages above the allowed rate",
    "kernel": "datagrams that the operating system dropped",
    "unknown_body": "frames without any body of the rig",
    "other_sender": "frames of a second sender of the same bodies",
    "backlog": "messages sent before the server listened",
    "late": "frames that came too late",
    "duplicate": "frames of an instant that had arrived before",
    "time_jump": "frames whose time is far from the others'",
    "mailbox_full": "frames that this machine was too slow for",
    "internal": "frames lost by a fault of the server",
    "nan": "bodies with numbers that are not finite",
    "bounds": "bodies more than 1000 m away",
    "zero_quaternion": "bodies whose rotation is all zeros",
    "conflict": "bodies that share their name or id",
    "frozen": "bodies that stood still although they are noisy",
    "swap": "bodies that changed places with each other",
    "zeros": "lost bodies that were sent as zeros",
    "handshake": "connections that do not speak the protocol, or have no key",
    "socket_type": "connections of the wrong type of socket",
    "not_listed": "connections whose key is not on the list",
    "too_many": "connections above the limit",
    "endless": "connections that sent without end",
    "token": "connections without the right token",
}
"""The reasons of `telemetry` and of the protocols, in the plural."""
JUMP: Final = "jump"
"""A body that jumps is not used for a fifth of a second. A replay that starts over makes every body jump, so this is
reported by itself and does not count as refused."""


def refusals_text(drops: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """The losses of `status` as Markdown, the newest first."""
    losses = [(reason, loss) for reasons in drops.values() for reason, loss in reasons.items() if loss["count"]]
    losses.sort(key=lambda each: each[1]["age_s"])
    refused = [(reason, loss) for reason, loss in losses if reason != JUMP]
    lines = ["Nothing was refused."]
    if refused:
        lines = ["| refused | | newest |", "|--:|---|--:|"]
        lines += [f"| {loss['count']} | {_words(reason)} | {ago(loss['age_s'])} |" for reason, loss in refused]
    jumps = [loss for reason, loss in losses if reason == JUMP]
    if jumps:
        lines += ["", f"Bodies jumped to another place {ago(jumps[0]['age_s'])}, as in a replay that starts over."]
    return "\n".join(lines)


def _words(reason: str) -> str:
    return REASONS.get(reason, escape(reason.replace("_", " ")))
