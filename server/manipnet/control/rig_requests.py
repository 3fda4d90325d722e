"""The request `save_rig`: what was changed while the server ran is written into the rig file."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.common.atomic_file import replacing
from manipnet.common.options import ConfigError
from manipnet.config.rig_changes import save_changes
from manipnet.config.settings import ActorConfig, BodyConfig, ObjectConfig
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.request import Handler, Request, RequestError
from manipnet.geometry import Array
from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.synthesis.objects.ply import ply_file

IDENTITY: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class RigRequests:
    """Saves into the file `rig`, if the server was started with one."""

    def __init__(self, proxy: ActorsProxy, catalog: ObjectCatalog, rig: Path | None) -> None:
        self._proxy, self._catalog, self._rig = proxy, catalog, rig
        self._backed_up = False

    def handlers(self) -> Mapping[str, Handler]:
        """One function per operation."""
        return {"save_rig": self._save}

    def _save(self, _: Request) -> dict[str, Any]:
        if self._rig is None:
            raise RequestError(
                "the server was started without --rig FILE, so there is no file to save into; `manipnet-serve "
                "--print-config > stage.toml` makes one"
            )
        rig = self._rig
        seen = self._proxy.ask(lambda: [_seen(actor) for actor in self._proxy.actors])
        look_ahead_s = self._proxy.ask(lambda: self._proxy.actors[0].look_ahead_s)
        try:
            actors = [self._config(*each, rig) for each in seen]
            save_changes(rig, actors, look_ahead_s, backup=not self._backed_up)
        except (ConfigError, OSError) as error:
            raise RequestError(str(error)) from None
        self._backed_up = True
        return {"stored": str(rig), "note": f"the file from before is kept as {rig.name}.bak"}

    def _config(
        self,
        config: ActorConfig,
        props: list[Prop],
        keys: Mapping[str, int | str],
        offsets: Mapping[str, Array],
        rig: Path,
    ) -> ActorConfig:
        """The configuration of an actor with the objects that its props carry now."""
        objects = []
        for prop in props:
            before = next((thing for thing in config.objects if thing.name == prop.name), None)
            body = before.body if before is not None else BodyConfig(keys[prop.name])
            if before is None and tuple(offsets[prop.name]) != IDENTITY:
                body = replace(body, offset=offsets[prop.name])
            objects.append(self._object(prop, body, rig))
        return replace(config, objects=tuple(objects))

    def _object(self, prop: Prop, body: BodyConfig, rig: Path) -> ObjectConfig:
        source = self._catalog.source(prop.object)
        if source is None or not source.path.is_file():  # it was dropped on the page, so it has no file here yet
            path = rig.resolve().parent / f"{prop.object}.ply"
            content = ply_file(prop.shape.mesh.vertices, prop.shape.mesh.faces)
            if path.exists() and path.read_bytes() != content:
                raise ConfigError(f"{path} already exists with another content; rename one of the two meshes")
            with replacing(path) as file:
                file.write(content)
            return ObjectConfig(prop.name, body, path, "m", prop.scale)
        return ObjectConfig(prop.name, body, source.path, source.unit, source.scale * prop.scale)


def _seen(actor: Actor) -> tuple[ActorConfig, list[Prop], dict[str, int | str], dict[str, Array]]:
    props = list(actor.props)
    return actor.config, props, actor.body_keys(), {prop.name: actor.offset(prop.name) for prop in props}
