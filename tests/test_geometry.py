"""Quaternions, poses and the mirror, by their axioms and against scipy."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from manipnet import geometry as g

vectors = arrays(np.float64, 3, elements=st.floats(-2.0, 2.0, width=32))
quats = arrays(np.float64, 4, elements=st.floats(-1.0, 1.0, width=32)).map(
    lambda q: q / np.linalg.norm(q) if np.linalg.norm(q) > 1e-3 else np.array([0.0, 0.0, 0.0, 1.0])
)
poses = st.tuples(vectors, quats).map(np.concatenate)


@given(quats, quats, vectors)
def test_product_and_rotation_agree_with_scipy(a, b, v):
    both = Rotation.from_quat(a) * Rotation.from_quat(b)
    np.testing.assert_allclose(g.quat_to_matrix(g.quat_multiply(a, b)), both.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(g.quat_rotate(a, v), Rotation.from_quat(a).apply(v), atol=1e-12)


@given(quats)
def test_matrix_and_quaternion_are_inverse_conversions(q):
    back = g.matrix_to_quat(g.quat_to_matrix(q))
    np.testing.assert_allclose(np.abs(back @ q), 1.0, atol=1e-12)


@given(quats)
def test_log_and_exp_are_inverse(q):
    assert np.linalg.norm(g.quat_log(q)) <= np.pi + 1e-9
    np.testing.assert_allclose(np.abs(g.quat_exp(g.quat_log(q)) @ q), 1.0, atol=1e-12)


@given(quats, quats, st.floats(0.0, 1.0))
def test_slerp_goes_the_short_way_at_constant_speed(a, b, fraction):
    whole = np.linalg.norm(g.quat_log(g.quat_multiply(g.quat_conjugate(a), b)))
    assume(whole < np.pi - 1e-3)
    part = np.linalg.norm(g.quat_log(g.quat_multiply(g.quat_conjugate(a), g.quat_slerp(a, b, fraction))))
    np.testing.assert_allclose(part, fraction * whole, atol=1e-7)


@given(poses, poses, vectors)
def test_composition_applies_one_pose_after_the_other(a, b, p):
    np.testing.assert_allclose(g.transform(g.compose(a, b), p), g.transform(a, g.transform(b, p)), atol=1e-10)
    np.testing.assert_allclose(g.transform(g.invert(a), g.transform(a, p)), p, atol=1e-10)


@given(poses, vectors)
def test_mirroring_twice_is_the_identity_and_mirrors_the_whole_scene(T, p):
    np.testing.assert_array_equal(g.mirror_poses(g.mirror_poses(T)), T)
    mirrored = g.transform(g.mirror_poses(T), g.mirror_points(p))
    np.testing.assert_allclose(mirrored, g.mirror_points(g.transform(T, p)), atol=1e-10)
    np.testing.assert_allclose(
        g.quat_to_matrix(g.mirror_quats(T[3:])), g.MIRROR @ g.quat_to_matrix(T[3:]) @ g.MIRROR, atol=1e-12
    )


def test_a_quaternion_without_direction_is_refused():
    for bad in ([0.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 1.0]):
        with pytest.raises(ValueError, match="direction"):
            g.quat_normalize(np.array(bad))
