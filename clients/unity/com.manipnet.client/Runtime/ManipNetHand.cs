using System;
using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>What follows the tracked wrist.</summary>
    public enum WristMode
    {
        /// <summary>Nothing: something else moves the arms.</summary>
        Keep,

        /// <summary>The hand, and the arm by two-bone IK.</summary>
        Arm,

        /// <summary>An object that an IK solver uses as its target.</summary>
        Target,
    }

    /// <summary>
    /// Moves the fingers of a rig, which is a Humanoid or has bones with known names under `root`. A Humanoid rests as its
    /// Avatar says; another rig as it is when this component is enabled.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Hand")]
    [DefaultExecutionOrder(100)]
    public sealed class ManipNetHand : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;
        [SerializeField] Side side = Side.Right;

        [Tooltip("Humanoid whose fingers move. Leave it empty to use bones by name under the root.")]
        [SerializeField] Animator animator;

        [Tooltip("Object under which bones are found by their names.")]
        [SerializeField] Transform root;

        [Tooltip("JSON that names bones with other names: {\"LeftHandIndex1\": \"a bone of the rig\"}.")]
        [SerializeField] TextAsset boneMap;

        [Tooltip("Makes the bones point where the synthesised ones do, whatever the rest pose of the rig is.")]
        [SerializeField] bool correctRestPose = true;

        [Tooltip("What follows the tracked wrist: nothing, the hand and the arm, or a target for your own IK.")]
        [SerializeField] WristMode wrist = WristMode.Keep;

        [Tooltip("Object that is moved to the wrist, with the rotation that the hand bone should have.")]
        [SerializeField] Transform wristTarget;

        readonly Quat[] _rotations = new Quat[HandRig.BoneCount];
        HandBones _bones;
        HandRig _rig;

        public void Configure(ManipNetReceiver from, Side which, Animator humanoid, Transform under, WristMode mode)
        {
            receiver = from;
            side = which;
            animator = humanoid;
            root = under;
            wrist = mode;
            if (isActiveAndEnabled) OnEnable();
        }

        public Side Side
        {
            get { return side; }
        }

        /// <summary>Sets the map of bones with unknown names, and finds the bones anew.</summary>
        public void SetBoneMap(TextAsset map)
        {
            boneMap = map;
            if (isActiveAndEnabled) OnEnable();
        }

        /// <summary>Sets the object that is moved to the wrist in the mode Target.</summary>
        public void SetWristTarget(Transform target)
        {
            wristTarget = target;
        }

        /// <summary>The bones that this component turns; null while there are none.</summary>
        public HandBones Bones
        {
            get { return _rig == null ? null : _bones; }
        }

        void OnEnable()
        {
            _rig = null;
            if (receiver == null || animator == null && root == null) return;
            try
            {
                _bones = HandBones.Find(animator, root, side, BoneMap.Parse(boneMap == null ? null : boneMap.text));
            }
            catch (ArgumentException error)
            {
                Debug.LogError("ManipNet: " + error.Message, this);
                return;
            }
            Report(_bones.Missing());
            if (_bones.Hand != null && _bones.AnyFinger) _rig = Bind();
        }

        void Report(List<string> missing)
        {
            if (missing.Count == 0) return;
            string what = "ManipNet: no bone for " + string.Join(", ", missing.ToArray()) + " of the " + (side == Side.Left ? "left" : "right") + " hand";
            if (_bones.Hand != null && _bones.AnyFinger) Debug.LogWarning(what + "; the other bones move", this);
            else Debug.LogError(what + "; use a Humanoid, a root whose bones have known names, or a bone map", this);
        }

        void LateUpdate()
        {
            if (_rig == null || !receiver.HasHands) return;
            HandFrame hand = receiver.Hands.Hand(side);
            if (!hand.Present) return;
            float weight = receiver.Weight;
            if (wrist != WristMode.Keep) MoveWrist(hand, weight);
            _rig.Solve(hand, _rotations);
            Quaternion space = _bones.Hand.rotation;
            for (int i = 0; i < _rotations.Length; i++)
            {
                if (_bones.Fingers[i] == null) continue;
                Quaternion turned = space * ManipNetPose.ToUnity(_rotations[i]);
                _bones.Fingers[i].rotation = Quaternion.Slerp(_bones.Fingers[i].rotation, turned, weight);
            }
        }

        void MoveWrist(HandFrame hand, float weight)
        {
            Vector3 position = ManipNetPose.Position(hand.Wrist, 0);
            Quaternion rotation = ManipNetPose.ToUnity(_rig.HandRotation(hand));
            if (wrist == WristMode.Arm) MoveArm(position, rotation, weight);
            else if (wristTarget != null)
            {
                wristTarget.position = position;
                wristTarget.rotation = rotation;
            }
        }

        void MoveArm(Vector3 position, Quaternion rotation, float weight)
        {
            Transform hand = _bones.Hand, lower = _bones.LowerArm, upper = _bones.UpperArm;
            Vector3 target = Vector3.Lerp(hand.position, position, weight);
            Quaternion turned = Quaternion.Slerp(hand.rotation, rotation, weight);
            if (lower != null && upper != null)
            {
                Quat upperTurn, lowerTurn;
                ArmIk.Solve(ManipNetPose.FromUnity(upper.position), ManipNetPose.FromUnity(lower.position),
                    ManipNetPose.FromUnity(hand.position), ManipNetPose.FromUnity(target), out upperTurn, out lowerTurn);
                Quaternion newLower = ManipNetPose.ToUnity(lowerTurn) * lower.rotation;
                upper.rotation = ManipNetPose.ToUnity(upperTurn) * upper.rotation;
                lower.rotation = newLower;
            }
            else
            {
                hand.position = target; // a rig that is only a hand
            }
            hand.rotation = turned;
        }

        HandRig Bind()
        {
            var positions = new Vec3[HandRig.BoneCount];
            var rotations = new Quat[HandRig.BoneCount];
            var present = new bool[HandRig.BoneCount];
            var tips = new Vec3[HandRig.Fingers.Length];
            var rest = new RestPose(animator);
            for (int i = 0; i < HandRig.BoneCount; i++)
            {
                Transform bone = _bones.Fingers[i];
                if (bone == null) continue;
                present[i] = true;
                rotations[i] = RestIn(rest, bone, out positions[i]);
                tips[i / 3] = End(rest, bone, positions[i], i, positions);
            }
            return new HandRig(side, positions, rotations, tips, correctRestPose, present);
        }

        /// <summary>The end of a finger's last bone: its first child, or where the bone before it points.</summary>
        Vec3 End(RestPose rest, Transform bone, Vec3 position, int index, Vec3[] positions)
        {
            Vec3 end;
            if (bone.childCount > 0)
            {
                RestIn(rest, bone.GetChild(0), out end);
                return end;
            }
            int before = index - 1;
            while (before >= index - index % 3 && _bones.Fingers[before] == null) before--;
            return before >= index - index % 3 ? position + (position - positions[before]) : 2f * position;
        }

        Quat RestIn(RestPose rest, Transform bone, out Vec3 position)
        {
            Vector3 at;
            Quaternion turned;
            rest.InSpaceOf(_bones.Hand, bone, out at, out turned);
            position = ManipNetPose.FromUnity(at);
            return ManipNetPose.FromUnity(turned);
        }
    }
}
