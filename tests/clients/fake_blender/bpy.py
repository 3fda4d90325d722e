"""The parts of Blender that the extension uses, complete enough to run it. The test decides when `timers` run."""

import re
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
from mathutils import Matrix


class Named(dict):
    """A collection that is indexed by name and iterates over its members, as Blender's collections do."""

    def __iter__(self):
        return iter(self.values())


class Object:
    def __init__(self, name, data=None):
        self.name, self.data, self.type = name, data, "ARMATURE" if data else "EMPTY"
        self.matrix_world = Matrix(np.eye(4))
        self.animation_data = None
        self.location, self.rotation_quaternion = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)

    def animation_data_create(self):
        self.animation_data = SimpleNamespace(action=None, action_slot=None)
        return self.animation_data


class Curve:
    def __init__(self):
        self.points, self.updated = np.empty(0), False
        self.keyframe_points = self

    def add(self, count):
        self.points = np.zeros(2 * count)

    def foreach_set(self, what, values):
        assert what == "co"
        assert len(values) == len(self.points)
        self.points[:] = values

    def update(self):
        self.updated = True


class Curves(dict):
    def new(self, path, index):
        assert re.fullmatch(r'pose\.bones\["[^"]+"\]\.(rotation_quaternion|location)', path)
        self[path, index] = Curve()
        return self[path, index]


class SlottedAction:
    """An action since Blender 4.4: its curves are in a channel bag of a slot, in a strip of a layer."""

    def __init__(self, name):
        self.name, self.curves = name, Curves()
        self.slots = SimpleNamespace(new=lambda id_type, name: (id_type, name))
        strip = SimpleNamespace(channelbag=lambda slot, ensure: SimpleNamespace(fcurves=self.curves))
        layer = SimpleNamespace(strips=SimpleNamespace(new=lambda type: strip))
        self.layers = SimpleNamespace(new=lambda name: layer)


class PlainAction:
    """An action before Blender 4.4."""

    def __init__(self, name):
        self.name, self.curves = name, Curves()
        self.fcurves = self.curves


class Timers:
    def __init__(self):
        self.registered = []

    def register(self, function, first_interval):
        self.registered.append(function)

    def unregister(self, function):
        self.registered.remove(function)

    def is_registered(self, function):
        return function in self.registered

    def run(self):
        """Call every function once; one that returns None is removed."""
        self.registered = [function for function in self.registered if function() is not None]


def new_object(name, data):
    data_objects[name] = Object(name, data)
    return data_objects[name]


data_objects = Named()
action_type = SlottedAction
objects = SimpleNamespace(get=data_objects.get, new=new_object)
data = SimpleNamespace(objects=objects, actions=SimpleNamespace(new=lambda name: action_type(name)))
scene = SimpleNamespace(
    frame_current=10,
    render=SimpleNamespace(fps=24, fps_base=1.0),
    collection=SimpleNamespace(objects=SimpleNamespace(link=lambda made: None)),
)
context = SimpleNamespace(scene=scene, window_manager=SimpleNamespace(windows=[]))
types = SimpleNamespace(
    Object=Object, PropertyGroup=object, Operator=object, Panel=object, Scene=type("Scene", (), {}), Context=object
)
props = MagicMock()
utils = SimpleNamespace(register_class=lambda cls: None, unregister_class=lambda cls: None, escape_identifier=str)
app = SimpleNamespace(timers=Timers(), handlers=SimpleNamespace(load_pre=[]))
