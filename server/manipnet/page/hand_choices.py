"""Which hand each actor shows on the page: the model's, a shipped one, or one that was dropped on the page."""

import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Final

from manipnet.geometry import SIDES
from manipnet.page.avatar_models import AvatarLook, plain_look
from manipnet.page.rpc import RpcClient
from manipnet.page.show import Show
from manipnet.synthesis.hand import shipped
from manipnet.synthesis.hand.profile import HandProfile, profile_to_json, read_profile

OWN: Final = "the model's hand"
IMPORT_S: Final = 60.0


class HandChoices:
    """The choices of all visitors together, because an actor has one avatar on the page. From any thread."""

    def __init__(self, link: RpcClient, show: Show) -> None:
        self._link, self._show = link, show
        self._dropped: dict[str, HandProfile] = {}
        self._looks: dict[str, AvatarLook] = {}
        """How each hand looks that was chosen; the scene draws the same look once."""
        self._chosen: dict[str, tuple[str, HandProfile]] = {}
        """By actor: the chosen hand, and its profile under the name that the server knows."""
        self._lock = threading.Lock()

    def names(self) -> tuple[str, ...]:
        """The hands that can be chosen."""
        return (OWN, *shipped.names(), *self._dropped)

    def of(self, actor: str) -> str:
        """The hand that is shown for an actor."""
        return self._chosen[actor][0] if actor in self._chosen else OWN

    def choose(self, actor: str, hand: str, several: bool) -> None:
        """Show a hand for an actor; `several` says whether there are more actors. Raises `RefusedError`."""
        with self._lock:
            if hand == OWN:
                self._chosen.pop(actor, None)
                self._show.show_avatar(actor, None, {})
            else:
                profile = self._dropped.get(hand) or shipped.load(hand)
                profile = replace(profile, name=f"{hand}@{actor}".replace(" ", "_") if several else hand)
                self._upload(actor, profile)
                self._chosen[actor] = hand, profile
                self._show.show_avatar(actor, profile.name, self._look(hand, profile))
            self._link.show_hands(profile.name for _, profile in self._chosen.values())

    def keep(self, known: Collection[tuple[str, str]]) -> None:
        """Upload again what the server has forgotten, because nobody watched.

        `known` are the names of its profiles, each with its actor.
        """
        with self._lock:
            for actor, (_, profile) in self._chosen.items():
                if (profile.name, actor) not in known:
                    self._upload(actor, profile)

    def add(self, name: str, content: bytes) -> str:
        """Import the hands of an avatar file as `manipnet hand import` does; returns the name of the hand.

        Raises `ValueError` with the reason of a refusal.
        """
        with tempfile.TemporaryDirectory(prefix="manipnet-") as folder:
            file, made = Path(folder) / Path(name).name, Path(folder) / "hand.json"
            file.write_bytes(content)
            command = [sys.executable, "-m", "manipnet_tools.cli", "hand", "import", str(file), "--no-picture"]
            command += ["--out", str(made)]
            try:
                done = subprocess.run(command, capture_output=True, text=True, timeout=IMPORT_S, check=False)
            except subprocess.TimeoutExpired:
                raise ValueError(f"{name}: the import took longer than {IMPORT_S:.0f} s") from None
            if done.returncode != 0 or not made.exists():
                lines = (done.stderr or done.stdout).strip().replace(f"{folder}/", "").splitlines()
                raise ValueError(" ".join(lines[-3:]) or f"{name}: cannot be imported")
            profile = read_profile(made)
        with self._lock:
            self._dropped = {**self._dropped, profile.name: profile}
            self._looks.pop(profile.name, None)
        return profile.name

    def _upload(self, actor: str, profile: HandProfile) -> None:
        self._link.ask(op="hand_profile", actor=actor, profile=json.loads(profile_to_json(profile)))

    def _look(self, hand: str, profile: HandProfile) -> AvatarLook:
        if hand not in self._looks:
            skins = hand not in self._dropped
            self._looks[hand] = {side: shipped.mesh(hand, side) for side in SIDES} if skins else plain_look(profile)
        return self._looks[hand]


def is_avatar(name: str, content: bytes) -> bool:
    """Whether a dropped file is an avatar and not a prop: a VRM file, or a GLB file with a skeleton."""
    suffix = Path(name).suffix.lower()
    return suffix == ".vrm" or (suffix == ".glb" and b'"skins"' in content[:_HEAD])


_HEAD: Final = 4 << 20
"""The JSON of a GLB file comes first, and is smaller than this."""
