using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Moves the fingers of a rig, which is a Humanoid or has bones with known names under `root`. The rig's pose at
    /// the moment when this component is enabled counts as its rest pose.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Hand")]
    [DefaultExecutionOrder(100)]
    public sealed class ManipNetHand : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;
        [SerializeField] Side side = Side.Right;

        [Tooltip("Humanoid whose fingers move. Leave it empty to use bones by name under the root.")]
        [SerializeField] Animator animator;

        [Tooltip("Object under which bones are found by the names of Unity, VMC, Mixamo, Unreal, Rigify or VRoid.")]
        [SerializeField] Transform root;

        [Tooltip("Makes the bones point where the synthesised ones do, whatever the rest pose of the rig is.")]
        [SerializeField] bool correctRestPose = true;

        [Tooltip("Also moves the hand to the tracked wrist. Turn it off if something else moves the arms.")]
        [SerializeField] bool moveWrist;

        readonly Transform[] _bones = new Transform[HandRig.BoneCount];
        readonly Quat[] _rotations = new Quat[HandRig.BoneCount];
        Transform _hand;
        HandRig _rig;

        public void Configure(ManipNetReceiver from, Side which, Animator humanoid, Transform under, bool wrist)
        {
            receiver = from;
            side = which;
            animator = humanoid;
            root = under;
            moveWrist = wrist;
            if (isActiveAndEnabled) OnEnable();
        }

        void OnEnable()
        {
            _rig = null;
            if (receiver == null || animator == null && root == null) return;
            var missing = new List<string>();
            FindBones(missing);
            if (missing.Count > 0)
                Debug.LogError("ManipNet: no bone for " + string.Join(", ", missing.ToArray()) + " of the " + (side == Side.Left ? "left" : "right")
                    + " hand; use a Humanoid, or a root whose bones have known names", this);
            else
                _rig = Bind();
        }

        void LateUpdate()
        {
            if (_rig == null || !receiver.HasHands) return;
            HandFrame hand = receiver.Hands.Hand(side);
            if (!hand.Present) return;
            float weight = receiver.Weight;
            if (moveWrist)
            {
                Quaternion turned = ManipNetPose.ToUnity(_rig.HandRotation(hand));
                _hand.position = Vector3.Lerp(_hand.position, ManipNetPose.Position(hand.Wrist, 0), weight);
                _hand.rotation = Quaternion.Slerp(_hand.rotation, turned, weight);
            }
            _rig.Solve(hand, _rotations);
            Quaternion space = _hand.rotation;
            for (int i = 0; i < _bones.Length; i++)
            {
                Quaternion turned = space * ManipNetPose.ToUnity(_rotations[i]);
                _bones[i].rotation = Quaternion.Slerp(_bones[i].rotation, turned, weight);
            }
        }

        void FindBones(List<string> missing)
        {
            bool humanoid = animator != null && animator.isHuman;
            Transform[] all = humanoid ? new Transform[0] : (root != null ? root : animator.transform).GetComponentsInChildren<Transform>(true);
            _hand = humanoid ? animator.GetBoneTransform(side == Side.Left ? HumanBodyBones.LeftHand : HumanBodyBones.RightHand) : null;
            bool metacarpal = false;
            foreach (Transform t in all)
            {
                if (RigNames.IsHand(t.name, side)) _hand = t;
                metacarpal |= RigNames.IsThumbMetacarpal(t.name, side);
            }
            if (_hand == null) missing.Add("Hand");
            for (int i = 0; i < _bones.Length; i++)
            {
                int finger = i / 3, part = i % 3;
                _bones[i] = humanoid ? animator.GetBoneTransform(HumanBone(i)) : null;
                foreach (Transform t in all)
                    if (RigNames.Matches(t.name, side, finger, part, metacarpal)) _bones[i] = t;
                if (_bones[i] == null) missing.Add(HandRig.Fingers[finger] + HandRig.Parts[part]);
            }
        }

        HumanBodyBones HumanBone(int i)
        {
            return (side == Side.Left ? HumanBodyBones.LeftThumbProximal : HumanBodyBones.RightThumbProximal) + i;
        }

        HandRig Bind()
        {
            var positions = new Vec3[HandRig.BoneCount];
            var rotations = new Quat[HandRig.BoneCount];
            var tips = new Vec3[HandRig.Fingers.Length];
            Quaternion toHand = Quaternion.Inverse(_hand.rotation);
            for (int i = 0; i < HandRig.BoneCount; i++)
            {
                positions[i] = ManipNetPose.FromUnity(toHand * (_bones[i].position - _hand.position));
                rotations[i] = ManipNetPose.FromUnity(toHand * _bones[i].rotation);
            }
            for (int finger = 0; finger < tips.Length; finger++)
            {
                Transform last = _bones[3 * finger + 2];
                Vec3 end = positions[3 * finger + 2];
                tips[finger] = last.childCount > 0
                    ? ManipNetPose.FromUnity(toHand * (last.GetChild(0).position - _hand.position))
                    : end + (end - positions[3 * finger + 1]);
            }
            return new HandRig(side, positions, rotations, tips, correctRestPose);
        }
    }
}
