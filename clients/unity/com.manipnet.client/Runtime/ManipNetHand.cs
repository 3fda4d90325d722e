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

        [Tooltip("Actor whose hand is shown; empty for the receiver's.")]
        [SerializeField] string actor = "";

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
        AvatarRig _avatar;
        string _avatarProblem;

        public void Configure(ManipNetReceiver from, Side which, Animator humanoid, Transform under, WristMode mode)
        {
            OnDisable();
            receiver = from;
            side = which;
            animator = humanoid;
            root = under;
            wrist = mode;
            if (isActiveAndEnabled) OnEnable();
        }

        /// <summary>The actor whose hand is shown; empty for the receiver's.</summary>
        public string Actor
        {
            get { return actor; }
            set { actor = value; }
        }

        /// <summary>The object under which the rig's bones are.</summary>
        public Transform Rig
        {
            get { return root != null || animator == null ? root : animator.transform; }
        }

        /// <summary>What the server must know to solve on this hand; null if the bones are not those of a hand.</summary>
        public HandProfile Profile
        {
            get { return _avatar == null ? null : _avatar.Profile; }
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

        void OnDisable()
        {
            if (receiver != null) receiver.Leave(this);
        }

        void OnEnable()
        {
            _rig = null;
            _avatar = null;
            _avatarProblem = null;
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
            if (_bones.Hand != null && _bones.AnyFinger) Bind();
            receiver.Join(this);
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
            if (_rig == null || receiver == null) return;
            HandsView solved = receiver.OfAvatar(this);
            if (receiver.SolveOnAvatar && _avatarProblem != null)
            {
                Debug.LogError("ManipNet: " + _avatarProblem, this);
                _avatarProblem = null;
            }
            bool exact = Shows(solved);
            HandsView view = exact ? solved : receiver.Of(actor); // until the server solves on the avatar, or if it refuses
            if (!Shows(view)) return;
            HandFrame hand = view.Hands.Hand(side);
            if (wrist != WristMode.Keep) MoveWrist(hand, exact, view.Weight);
            if (exact) _avatar.Solve(hand, _rotations);
            else _rig.Solve(hand, _rotations);
            Quaternion space = _bones.Hand.rotation;
            for (int i = 0; i < _rotations.Length; i++)
            {
                if (_bones.Fingers[i] == null) continue;
                Quaternion turned = space * ManipNetPose.ToUnity(_rotations[i]);
                _bones.Fingers[i].rotation = Quaternion.Slerp(_bones.Fingers[i].rotation, turned, view.Weight);
            }
        }

        bool Shows(HandsView view)
        {
            return view != null && view.HasHands && view.Weight > 0f && view.Hands.Hand(side).Present;
        }

        void MoveWrist(HandFrame hand, bool exact, float weight)
        {
            Vector3 position = exact ? ManipNetPose.ToUnity(_avatar.HandPosition(hand)) : ManipNetPose.Position(hand.Wrist, 0);
            Quaternion rotation = ManipNetPose.ToUnity(exact ? _avatar.HandRotation(hand) : _rig.HandRotation(hand));
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

        /// <summary>Prepares both ways to pose the fingers: by rotations alone, and on the avatar's own joints.</summary>
        void Bind()
        {
            var rest = new RestPose(animator);
            RestHand own = _bones.AtRest(rest, Vector3.one);
            var tips = new Vec3[HandRig.FingerCount];
            for (int finger = 0; finger < tips.Length; finger++) tips[finger] = own.HasTip[finger] ? own.Tips[finger] : Continued(own, finger);
            _rig = new HandRig(side, own.Positions, own.Rotations, tips, correctRestPose, own.Present);
            try
            {
                _avatar = new AvatarRig(side, _bones.AtRest(rest, _bones.Hand.lossyScale));
            }
            catch (ArgumentException error)
            {
                _avatarProblem = error.Message;
            }
        }

        /// <summary>The end of a finger without a bone there: where the bone before the last one points.</summary>
        static Vec3 Continued(RestHand rest, int finger)
        {
            int last = 3 * finger + 2, first = 3 * finger;
            while (last > first && !rest.Present[last]) last--;
            int before = last - 1;
            while (before >= first && !rest.Present[before]) before--;
            return before >= first ? rest.Positions[last] + (rest.Positions[last] - rest.Positions[before]) : 2f * rest.Positions[last];
        }
    }
}
