"""ManipNet as a torch module (paper, section 6.2), with its normalisation inside, and its export to ONNX."""

import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from manipnet.geometry import Array
from manipnet.synthesis.model.layout import PRESENT, Block, Layout
from manipnet_tools.training.augment import Policy
from manipnet_tools.training.config import Architecture

_INPUT_FLOORS = {
    "joint_positions": 2e-3,
    "joint_axes": 2e-2,
    "wrist_positions": 5e-3,
    "wrist_axes": 2e-2,
    "other_wrist_distances": 1e-2,
    "object_centers": 5e-3,
    "object_angular_velocities": 0.2,
    "ambient": 5e-2,
    "proximity": 5e-3,
    "signed_distances": 3e-3,
    "surface_normals": 5e-2,
}
_OUTPUT_FLOORS = {"joint_positions": 2e-3, "joint_axes": 2e-2, "distances": 2e-3}
_CHANGE_FLOORS = {"joint_positions": 2e-4, "joint_axes": 2e-3, "distances": 2e-3}


@dataclass(frozen=True)
class Normalisation:
    """Mean and standard deviation of every column.

    Deviations have a floor, because columns that hardly move would amplify noise a thousandfold.
    """

    input_mean: np.ndarray
    input_std: np.ndarray
    output_mean: np.ndarray
    output_std: np.ndarray
    predicts_change: bool
    """Whether the output statistics are of the change from the pose in the inputs."""


def normalisation(layout: Layout, inputs: np.ndarray, outputs: np.ndarray, predict_change: bool) -> Normalisation:
    """Statistics of samples `(N, input_size)` and `(N, output_size)`."""
    pose = layout.encoded["pose"]
    if predict_change:
        outputs = outputs.copy()
        outputs[:, pose] -= inputs[:, pose]
    floors = _CHANGE_FLOORS if predict_change else _OUTPUT_FLOORS
    return Normalisation(
        *_statistics(inputs, _floors(layout.input, _INPUT_FLOORS)),
        *_statistics(outputs, _floors(layout.output, floors)),
        predict_change,
    )


def _statistics(values: np.ndarray, floors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    std = np.maximum(values.std(axis=0, dtype=np.float64), floors)
    return values.mean(axis=0, dtype=np.float64).astype(np.float32), std.astype(np.float32)


def _floors(blocks: Mapping[str, Block], floors: Mapping[str, float]) -> np.ndarray:
    return np.concatenate([np.full(block.stop - block.start, floors[name]) for name, block in blocks.items()])


_FUTURE = {
    **dict.fromkeys(
        ("wrist_positions", "wrist_axes", "other_wrist_distances", "object_centers", "object_angular_velocities"),
        PRESENT + 3,
    ),
    "proximity": 2,
    "signed_distances": 2,
}
"""First row of each block that lies more than 0.1 s ahead."""


def hidden_columns(layout: Layout, names: Sequence[str]) -> np.ndarray:
    """Mask `(input_size,)` of the inputs in the named blocks; `future` names everything more than 0.1 s ahead."""
    mask = np.zeros(layout.input_size, dtype=np.bool_)
    for name in names:
        if name == "future":
            for block, first in _FUTURE.items():
                rows = np.arange(layout.input_size)[layout.input[block].columns].reshape(layout.input[block].shape)
                mask[rows[first:].ravel()] = True
        else:
            mask[layout.input[name].columns] = True
    return mask


class ResidualDenseBlock(nn.Module):
    """`a = relu(x); h = W a + b + a; c = relu(h); y = V c + d + c + a`; without `dense` the long path is left out."""

    def __init__(self, width: int, dropout: float, dense: bool = True, residual: bool = True) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(width, width), nn.Linear(width, width)
        self.dropout, self.dense, self.residual = nn.Dropout(dropout), dense, residual

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """`(N, width)` to `(N, width)`."""
        a = torch.relu(x)
        h = self.first(self.dropout(a)) + (a if self.dense else 0.0)
        c = torch.relu(h)
        y = self.second(self.dropout(c)) + (c if self.dense else 0.0)
        return y + a if self.residual else y


class ManipNet(nn.Module):
    """The network: three linear encoders, two residual dense blocks and a linear decoder. It works in SI units."""

    input_mean: torch.Tensor
    input_gain: torch.Tensor
    output_mean: torch.Tensor
    output_std: torch.Tensor

    def __init__(
        self,
        layout: Layout,
        norm: Normalisation,
        width: int = 1536,
        dropout: float = 0.3,
        architecture: Architecture = "manipnet",
        hidden: Sequence[str] = (),
    ) -> None:
        """`hidden` names inputs that the network does not see: blocks of the layout, or `future` beyond 0.1 s."""
        super().__init__()
        for name in ("input_mean", "output_mean", "output_std"):
            self.register_buffer(name, torch.from_numpy(getattr(norm, name).copy()))
        gain = 1.0 / norm.input_std
        gain[hidden_columns(layout, hidden)] = 0.0
        self.register_buffer("input_gain", torch.from_numpy(gain))
        self.predicts_change = norm.predicts_change
        self.layout = layout
        self._encoded_sizes = [columns.stop - columns.start for columns in layout.encoded.values()]
        third = width // 3
        self.encoders = nn.ModuleList(nn.Linear(size, third) for size in self._encoded_sizes)
        dense, residual = architecture == "manipnet", architecture != "mlp"
        self.blocks = nn.Sequential(*(ResidualDenseBlock(3 * third, dropout, dense, residual) for _ in range(2)))
        self.decoder = nn.Linear(3 * third, layout.output_size)
        self.dropout = nn.Dropout(dropout)
        for layer in self.modules():
            if isinstance(layer, nn.Linear):
                nn.init.xavier_uniform_(layer.weight)
                nn.init.zeros_(layer.bias)

    def normalised(self, features: torch.Tensor) -> torch.Tensor:
        """Outputs in standard deviations from their mean, of which the loss is made."""
        x = (features - self.input_mean) * self.input_gain
        parts = [
            encode(self.dropout(part))
            for encode, part in zip(self.encoders, torch.split(x, self._encoded_sizes, dim=1), strict=True)
        ]
        return self.decoder(self.dropout(self.blocks(torch.cat(parts, dim=1))))

    def normalise_outputs(self, features: torch.Tensor, outputs: torch.Tensor) -> torch.Tensor:
        """The answer of `normalised` that stands for these outputs."""
        return (outputs - self._base_pose(features) - self.output_mean) / self.output_std

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Features `(N, input_size)` to outputs `(N, output_size)`."""
        outputs = self.normalised(features) * self.output_std + self.output_mean
        return outputs + self._base_pose(features) if self.predicts_change else outputs  # adding zero costs five nodes

    def _base_pose(self, features: torch.Tensor) -> torch.Tensor:
        """The pose to which a predicted change is added; zero for a model that predicts the pose itself."""
        pose, _, _ = torch.split(features, self._encoded_sizes, dim=1)
        if not self.predicts_change:
            pose = torch.zeros_like(pose)
        return torch.nn.functional.pad(pose, (0, self.layout.output_size - self._encoded_sizes[0]))


def policy_of(model: ManipNet) -> Policy:
    """The model as a function from features `(N, input_size)` float32 to outputs `(N, output_size)`."""
    model.eval()

    def policy(rows: np.ndarray) -> Array:
        with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
            outputs = model(torch.from_numpy(rows))
        return outputs.double().numpy()

    return policy


def export_onnx(model: ManipNet) -> bytes:
    """The model as ONNX with dynamic batch, `features` in and `outputs` out, weights in single precision."""
    model = model.eval().float()
    buffer = io.BytesIO()
    with torch.no_grad(), warnings.catch_warnings():
        # the older exporter is chosen on purpose: it needs no further package
        warnings.simplefilter("ignore", DeprecationWarning)
        warnings.filterwarnings("ignore", "Constant folding")
        torch.onnx.export(
            model,
            (torch.zeros(2, model.layout.input_size),),
            buffer,  # pyright: ignore[reportArgumentType]: the older exporter takes files
            dynamo=False,
            input_names=["features"],
            output_names=["outputs"],
            dynamic_axes={"features": {0: "hands"}, "outputs": {0: "hands"}},
            opset_version=17,
        )
    return buffer.getvalue()
