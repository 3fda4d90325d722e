# ruff: noqa: E402
"""Training uses the right frames, a model learns, and its bundle can be loaded."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

torch = pytest.importorskip("torch", reason="training needs the train extra")

from manipnet.common.options import ConfigError
from manipnet.geometry import quat_exp
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.layout import PRESENT, layout_of
from manipnet.synthesis.model.shipped import BundleError, shipped_hand
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet_tools.evaluation import ablate
from manipnet_tools.evaluation.options import ABLATION_TRAINING, AblateOptions
from manipnet_tools.generate.free_hand import free_hand
from manipnet_tools.generate.proportions import Proportions, proportioned
from manipnet_tools.takes.dataset import DataError
from manipnet_tools.training import quantise
from manipnet_tools.training.augment import SLIDE_M_S, drawn_slides, with_slides
from manipnet_tools.training.config import TrainConfig
from manipnet_tools.training.dataset import CapturedHand, TakeSet
from manipnet_tools.training.model import hidden_columns
from manipnet_tools.training.options import QuantiseOptions
from manipnet_tools.training.sampler import FUTURE_FRAMES, Posed, RoundSampler, main_hand
from manipnet_tools.training.start import read_start
from manipnet_tools.training.train import Trainer, new_model, train
from manipnet_tools.training.trained import save_bundle

HAND = shipped_hand()
LAYOUT = layout_of(HAND)

torch.set_num_threads(1)
FRAMES = 480
TINY = TrainConfig(width=24, rounds=2, epochs_per_round=2, batch=32, roll_out_ticks=5, dropout=0.0)


@pytest.fixture(scope="module")
def hands(tmp_path_factory):
    """A hand that closes and opens in step with its distance to a ball, and one that does so mirrored."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    shape = build_shape(closed_mesh(ball.vertices, ball.faces, "ball"), tmp_path_factory.mktemp("cache"))
    t = np.arange(FRAMES) / 120.0
    closed = 0.5 + 0.5 * np.sin(2.0 * t)
    angles = HAND.limits[:, 0] + (0.3 + 0.4 * closed[:, None]) * (HAND.limits[:, 1] - HAND.limits[:, 0])
    wrist = np.stack([np.concatenate([[0.0, 1.0, 0.1 * s], quat_exp(np.array([0.0, 0.2 * s, 0.0]))]) for s in closed])
    obj = np.tile([0.1, 0.97, 0.0, 0.0, 0.0, 0.0, 1.0], (FRAMES, 1))
    other = np.tile([0.5, 1.0, 0.0], (FRAMES, 1))
    takes = [CapturedHand(f"take{k}/right", HAND, shape, bool(k), wrist, other, obj, angles) for k in range(2)]
    return [TakeSet(takes)]


@pytest.fixture(scope="module")
def learned(hands):
    return train(hands, TINY)


def test_reversing_a_take_twice_restores_it(hands):
    captured = hands[0].hands[0]
    flipped = captured.backwards()
    np.testing.assert_array_equal(flipped.angles[0], captured.angles[-1])
    np.testing.assert_array_equal(flipped.backwards().wrist, captured.wrist)
    frames = np.array([200, 300])
    np.testing.assert_allclose(
        flipped.windows(frames).object[:, ::-1], captured.windows(FRAMES - 1 - frames).object, atol=1e-12
    )


def test_frames_after_the_share_are_never_used(hands):
    """The samples do not depend on the rest of a take."""
    share = 0.6
    last = int(FRAMES * share)
    torn = [
        replace(captured, angles=captured.angles.copy(), wrist=captured.wrist.copy()) for captured in hands[0].hands
    ]
    for captured in torn:
        captured.angles[last:] = HAND.limits[:, 0]
        captured.wrist[last:, :3] += 1.0
    config = replace(TINY, warp=0.0)
    assert last > 2 * FUTURE_FRAMES
    ours, theirs = (RoundSampler(of, config, share).next_round(None) for of in (hands, [TakeSet(torn)]))
    np.testing.assert_array_equal(ours.inputs, theirs.inputs)
    np.testing.assert_array_equal(ours.outputs, theirs.outputs)


def test_a_model_learns(hands):
    sampler = RoundSampler(hands, TINY, 1.0)
    samples = sampler.next_round(None)
    torch.manual_seed(0)
    config = replace(TINY, rounds=1, epochs_per_round=8, learning_rate=3e-3, huber=0.0)
    trainer = Trainer(new_model(HAND, samples, config), config)
    assert trainer.learn(samples) < 0.5, "a constant answer has a mean squared deviation of one"


def test_objects_that_slide_in_the_hand_are_now_where_they_were(hands):
    captured = hands[0].hands[0]
    frames, rng = np.array([100, 200, 300]), np.random.default_rng(0)
    windows = captured.windows(frames)
    assert with_slides(windows, drawn_slides(3, 0.0, rng)) is windows
    slid = with_slides(windows, drawn_slides(3, 1.0, rng))
    assert np.allclose(slid.object[:, PRESENT], windows.object[:, PRESENT])
    away = np.linalg.norm(slid.object[..., :3] - windows.object[..., :3], axis=2)
    assert (away[:, [0, -1]] > 0.005).all()
    assert away.max() < 0.5 * 5.0 * SLIDE_M_S * np.sqrt(3.0)
    assert np.allclose(slid.wrist, windows.wrist)
    some = drawn_slides(1000, 0.3, rng).any(axis=(1, 2))
    assert 0.25 < some.mean() < 0.35


def test_the_same_seed_gives_the_same_model(hands, learned):
    again, other = train(hands, TINY), train(hands, replace(TINY, seed=1))
    weights, repeated, others = (
        torch.cat([p.detach().flatten() for p in of.model.parameters()]) for of in (learned, again, other)
    )
    assert torch.equal(weights, repeated)
    assert not torch.equal(weights, others)


def test_a_bundle_answers_like_its_model_and_names_its_takes(learned, tmp_path):
    save_bundle(learned, tmp_path / "mine")
    bundle = load_bundle(tmp_path / "mine")
    rows = np.random.default_rng(0).normal(0.0, 0.1, (3, LAYOUT.input_size)).astype(np.float32)
    with torch.no_grad():
        expected = learned.model(torch.from_numpy(rows)).numpy()
    np.testing.assert_allclose(bundle.infer(rows), expected, atol=2e-2)
    assert bundle.meta["training"]["takes"] == ["take0", "take1"]
    assert "CC BY-NC 4.0" in bundle.meta["licence"]


def test_a_quantised_bundle_is_smaller_and_nearly_the_same(hands, tmp_path):
    wide = train(hands, replace(TINY, width=192, rounds=1, epochs_per_round=1))
    save_bundle(wide, tmp_path / "wide")
    quantise.run(QuantiseOptions(str(tmp_path / "wide"), tmp_path / "small"))
    ours, small = load_bundle(tmp_path / "wide"), load_bundle(tmp_path / "small")
    rows = RoundSampler(hands, TINY, 1.0).next_round(None).inputs[:64]
    spread = ours.infer(rows).std(axis=0).mean()
    assert np.abs(ours.infer(rows) - small.infer(rows)).mean() < 0.1 * spread + 1e-3
    sizes = [(tmp_path / name / "manipnet.onnx").stat().st_size for name in ("wide", "small")]
    assert sizes[1] < 0.7 * sizes[0]
    assert small.meta["quantised_from_sha256"] == ours.meta["model_sha256"]
    assert small.model_hash != ours.model_hash


def test_hidden_inputs_do_not_reach_the_network(hands, tmp_path):
    blind = train(hands, replace(TINY, rounds=1, epochs_per_round=1, hidden=("ambient", "future")))
    rows = np.zeros((1, LAYOUT.input_size), np.float32)
    changed = rows + hidden_columns(LAYOUT, ("ambient", "future")) * np.float32(3.0)
    with torch.no_grad():
        assert torch.equal(blind.model(torch.from_numpy(rows)), blind.model(torch.from_numpy(changed)))
        changed[:, LAYOUT.input["proximity"].start] = 1.0
        assert not torch.equal(blind.model(torch.from_numpy(rows)), blind.model(torch.from_numpy(changed)))


def test_every_row_of_the_ablation_is_trained_once(hands, tmp_path):
    options = AblateOptions(tmp_path, tmp_path, training=replace(ABLATION_TRAINING, width=12, rounds=1))
    ablate.train_rows(hands[0].hands, options, "fold", 1.0)
    written = {row: ablate.folder_of(tmp_path, row, "fold") / "bundle.json" for row in ablate.ROWS}
    stamps = {row: path.stat().st_mtime_ns for row, path in written.items()}
    ablate.train_rows(hands[0].hands, options, "fold", 1.0)
    assert stamps == {row: path.stat().st_mtime_ns for row, path in written.items()}
    configs = [json.loads(path.read_text())["training"] for path in written.values()]
    assert len({(c["architecture"], *c["hidden"]) for c in configs}) == len(ablate.ROWS)


def test_training_goes_on_from_a_bundle(hands, learned, tmp_path):
    save_bundle(replace(learned, licence="ours; trained on one set"), tmp_path / "first")
    start, config = read_start(str(tmp_path / "first"), replace(TINY, width=768, rounds=1, epochs_per_round=1))
    assert config.width == TINY.width, "the width belongs to the weights"
    assert start.licence == "ours; trained on one set"
    rows = RoundSampler(hands, TINY, 1.0).next_round(None).inputs[:64]
    with torch.no_grad():
        before, bundle = start.network(torch.from_numpy(rows)), load_bundle(tmp_path / "first")
    np.testing.assert_allclose(before.numpy(), bundle.infer(rows), atol=1e-5)
    gone_on, anew = train(hands, replace(config, learning_rate=1e-6), start=start), train(hands, config)
    with torch.no_grad():
        after, fresh = (of.model(torch.from_numpy(rows)) for of in (gone_on, anew))
    assert (after - before).abs().mean() < 0.1 * (fresh - before).abs().mean()


def test_a_quantised_bundle_is_not_gone_on_from(hands, tmp_path):
    save_bundle(train(hands, replace(TINY, width=192, rounds=1, epochs_per_round=1)), tmp_path / "wide")
    quantise.run(QuantiseOptions(str(tmp_path / "wide"), tmp_path / "small"))
    with pytest.raises(BundleError, match="has quantised weights"):
        read_start(str(tmp_path / "small"), TINY)


def test_the_bundle_is_written_after_each_round(hands):
    seen = []
    train(hands, TINY, after_round=lambda now, text: seen.append(text))
    assert [text.partition("  ")[0] for text in seen] == ["round 1/2", "round 2/2"]


def test_sets_give_samples_by_weight_and_a_round_is_no_larger_than_it_may_be(hands):
    long, short = replace(hands[0], weight=1.0), TakeSet([hands[0].hands[0]], weight=3.0)
    sampler = RoundSampler(
        [long, short], replace(TINY, round_samples=400, captured=0.5, blended=0.5, on_policy=0.0), 1.0
    )
    assert 390 <= len(sampler.next_round(None)) <= 400
    assert [round(part.thinned * sum(b - a for a, b in part.spans)) for part in sampler._parts] == [100, 300]


def test_hands_of_other_proportions_and_frames_are_learned_together(hands):
    """Each take is sampled and rolled out with its own hand, in the bone frames of the model's."""
    other = proportioned(free_hand(), Proportions(1.15, 0.95, 1.1, (0.004, 0.01)), "another")
    free = TakeSet([replace(captured, hand=other) for captured in hands[0].hands])
    model = train([hands[0], free], replace(TINY, rounds=2))
    assert model.hand is HAND
    sampler = RoundSampler([hands[0], free], TINY, 1.0)
    used = sampler._parts[1].hands[0].hand
    low, high = other.limits.T
    angles = np.random.default_rng(0).uniform(low, high, (20, other.angle_count))
    np.testing.assert_allclose(forward_kinematics(used, angles)[0], forward_kinematics(other, angles)[0], atol=1e-9)
    rest = np.concatenate([captured.angles[FUTURE_FRAMES:-FUTURE_FRAMES:4] for captured in hands[0].hands]).mean(axis=0)
    ours, theirs = (forward_kinematics(hand, rest)[1] for hand in (used, HAND))
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
    samples = sampler.next_round(model.model)
    assert np.isfinite(samples.inputs).all()
    assert np.isfinite(samples.outputs).all()


def test_the_model_poses_the_hand_that_most_takes_of_the_first_set_have(hands):
    other = proportioned(free_hand(), Proportions(1.1), "another")
    first, second = hands[0].hands
    assert main_hand(TakeSet([replace(first, hand=other), second, first])) is HAND


def test_short_takes_are_left_out_and_need_no_roll_outs(hands):
    """A take of 1.2 s, as `manipnet import` may leave one, has samples but is too short for roll-outs."""
    whole, config = hands[0].hands[0], replace(TINY, roll_out_ticks=40)
    arrays = ("wrist", "other_wrist", "object", "angles")
    cut = {n: replace(whole, **{name: getattr(whole, name)[:n] for name in arrays}) for n in (100, 150)}
    model = train(hands, replace(TINY, rounds=1)).model
    assert len(RoundSampler([TakeSet([cut[150], cut[100]])], config, 1.0).next_round(model)) == 9 + 18
    with pytest.raises(DataError, match=r"no take is long enough to train on; one must have at least 1\.01 s"):
        RoundSampler([TakeSet([cut[100]])], config, 1.0)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"rounds": 0}, "--training.rounds is 0; it must be at least 1"),
        ({"round_samples": 31, "batch": 32}, "--training.round-samples is 31; it must be at least 32"),
        ({"captured": 0.0, "blended": 0.0}, "one of the first two must be above 0"),
        ({"on_policy": -0.1}, "must not be negative"),
    ],
)
def test_numbers_with_which_nothing_can_be_trained_are_named(change, reason):
    with pytest.raises(ConfigError, match=reason):
        replace(TrainConfig(), **change).check()


def test_going_on_with_the_same_hand_keeps_the_frames_of_its_bones(hands):
    """Also where the takes differ, so that the mean pose is another one."""
    other = [replace(captured, angles=captured.angles + 0.1) for captured in hands[0].hands]
    sampler = RoundSampler([TakeSet(other), hands[0]], TINY, 1.0, Posed(HAND, HAND.limits.mean(axis=1)))
    assert sampler.hand is HAND
    assert all(captured.hand is HAND for part in sampler._parts for captured in part.hands)
