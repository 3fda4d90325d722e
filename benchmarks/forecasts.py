"""Errors of forecasts of wrists and props: `python -m benchmarks.forecasts DATASET`.

It compares the fading velocity of `manipnet.tracking.forecast` with a body that stands still and with a linear
predictor. The linear predictor's displacement at each horizon is a weighted sum of the displacements since 1, 2, 4 and
8 sixtieths of a second ago. Its weights are fitted to the first four fifths of every take, with the noise of a tracker,
separately for wrists and props. The errors are those on the last fifth.
"""

import sys
from pathlib import Path

import numpy as np

from manipnet.geometry import Array, quat_conjugate, quat_exp, quat_log, quat_multiply
from manipnet.tracking.forecast import FADE_S, FADE_SPIN_S, damped_velocity
from manipnet_tools.takes.take import read_take

TICK_S = 1.0 / 60.0
LAGS, AHEAD = np.array([1, 2, 4, 8]), np.array([3, 6, 9, 12, 18, 24, 30])
SEEN_SHARE = 0.8
NOISE = np.repeat([3e-4, np.radians(0.1)], 3)
"""Standard deviations per axis: metres, radians."""
HISTORY = 12
"""Ticks of the past that a forecast may use."""


def bodies(folder: Path) -> dict[str, list[Array]]:
    """Poses `(T, 7)` at 60 Hz of all wrists and all props."""
    found: dict[str, list[Array]] = {"wrists": [], "props": []}
    for path in sorted((folder / "BVH").iterdir()):
        take = read_take(path)
        for name, track in take.bodies.items():
            found["wrists" if name.endswith("wrist") else "props"].append(track.poses[:: round(take.rate_hz / 60)])
    return found


def shaken(poses: Array, rng: np.random.Generator) -> Array:
    """The poses with the noise of a tracker."""
    noise = rng.normal(size=(len(poses), 6)) * NOISE
    turned = quat_multiply(quat_exp(noise[:, 3:]), poses[:, 3:])
    return np.concatenate([poses[:, :3] + noise[:, :3], turned], axis=1)


def between(before: Array, after: Array) -> Array:
    """Displacement and rotation vector from one pose to another, `(..., 6)`."""
    turn = quat_log(quat_multiply(after[..., 3:], quat_conjugate(before[..., 3:])))
    return np.concatenate([after[..., :3] - before[..., :3], turn], axis=-1)


def samples(true: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Displacements at every tick: past ones `(n, lags, 6)`, true future ones `(n, ahead, 6)`, and predicted ones.

    The predictions are those of the fading velocity.
    """
    seen, at = shaken(true, rng), np.arange(HISTORY, len(true) - AHEAD[-1])
    past = np.stack([between(seen[at - lag], seen[at]) for lag in LAGS], axis=1)
    future = np.stack([between(seen[at], true[at + ahead]) for ahead in AHEAD], axis=1)
    times, to_come = TICK_S * np.arange(-HISTORY, 1, dtype=float), TICK_S * AHEAD
    fading = np.stack([damped_velocity(times, np.ascontiguousarray(seen[k - HISTORY : k + 1]), to_come) for k in at])
    return past, future, between(seen[at][:, None], fading)


def fitted(past: Array, future: Array) -> Array:
    """Weights `(2, lags, ahead)` for positions and rotations with the least mean error, by iterative reweighting."""
    weights = np.empty((2, len(LAGS), len(AHEAD)))
    for part in range(2):
        x, y = past[..., 3 * part : 3 * part + 3], future[..., 3 * part : 3 * part + 3]
        for h in range(len(AHEAD)):
            share, least = np.ones(len(x)), np.zeros(len(LAGS))
            for _ in range(12):
                square = np.einsum("n,nlk,nmk->lm", share, x, x)
                square += 1e-6 * np.trace(square) * np.eye(len(LAGS))
                least = np.linalg.solve(square, np.einsum("n,nlk,nk->l", share, x, y[:, h]))
                share = 1.0 / np.maximum(np.linalg.norm(np.einsum("nlk,l->nk", x, least) - y[:, h], axis=1), 1e-3)
            weights[part, :, h] = least
    return weights


def main() -> None:
    """Print the mean errors for each horizon."""
    rng = np.random.default_rng(0)
    print(f"fading velocity: time constants {FADE_S:g} s and, turning, {FADE_SPIN_S:g} s")
    print("mean error after    " + "".join(f"{TICK_S * ahead:8.2f} s" for ahead in AHEAD))
    for kind, tracks in bodies(Path(sys.argv[1])).items():
        cuts = [int(SEEN_SHARE * len(poses)) for poses in tracks]
        train = [samples(poses[:cut], rng) for poses, cut in zip(tracks, cuts, strict=True)]
        past, future, fading = (
            np.concatenate(parts)
            for parts in zip(*(samples(poses[cut:], rng) for poses, cut in zip(tracks, cuts, strict=True)), strict=True)
        )
        weights = fitted(*(np.concatenate(parts) for parts in list(zip(*train, strict=True))[:2]))
        for part, unit, factor in ((0, "mm", 1e3), (1, "degrees", np.degrees(1.0))):
            columns = slice(3 * part, 3 * part + 3)
            linear = np.einsum("nlk,lh->nhk", past[..., columns], weights[part])
            for name, guess in (("still", 0.0), ("fading", fading[..., columns]), ("linear", linear)):
                error = factor * np.linalg.norm(future[..., columns] - guess, axis=-1).mean(axis=0)
                print(f"{kind:7} {name:7} {unit:7}" + "".join(f"{value:8.2f}  " for value in error))


if __name__ == "__main__":
    main()
