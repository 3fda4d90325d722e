using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>The bones of one hand of a rig, and of the arm it hangs on. A bone that the rig lacks is null.</summary>
    public sealed class HandBones
    {
        const float SamePlace = 0.006f; // relative to the distance from the hand, so that the unit does not matter

        public Transform Hand, LowerArm, UpperArm;

        /// <summary>15 finger bones, thumb to little finger, proximal to distal.</summary>
        public readonly Transform[] Fingers = new Transform[HandRig.BoneCount];

        /// <summary>The bones in the palm, by finger; the thumb has none.</summary>
        public readonly Transform[] Metacarpals = new Transform[HandRig.FingerCount];

        /// <summary>
        /// Finds the bones of a Humanoid, or by their names under `root`. A bone that the map names wins over both.
        /// </summary>
        public static HandBones Find(Animator animator, Transform root, Side side, BoneMap map)
        {
            var found = new HandBones();
            bool humanoid = animator != null && animator.isHuman;
            if (humanoid) found.TakeHumanoid(animator, side);
            Transform top = root != null ? root : animator.transform;
            found.TakeNamed(top.GetComponentsInChildren<Transform>(true), side, map, humanoid);
            if (found.LowerArm == null) found.LowerArm = Above(found.Hand, top);
            if (found.UpperArm == null) found.UpperArm = Above(found.LowerArm, top);
            return found;
        }

        public bool AnyFinger
        {
            get { return System.Array.Exists(Fingers, bone => bone != null); }
        }

        /// <summary>The names of the missing bones; a finger that is missing altogether is named once.</summary>
        public List<string> Missing()
        {
            var missing = new List<string>();
            if (Hand == null) missing.Add("Hand");
            for (int finger = 0; finger < HandRig.Fingers.Length; finger++)
            {
                if (Fingers[3 * finger] == null && Fingers[3 * finger + 1] == null && Fingers[3 * finger + 2] == null)
                {
                    missing.Add(HandRig.Fingers[finger]);
                    continue;
                }
                for (int part = 0; part < 3; part++)
                    if (Fingers[3 * finger + part] == null) missing.Add(HandRig.Fingers[finger] + HandRig.Parts[part]);
            }
            return missing;
        }

        void TakeHumanoid(Animator animator, Side side)
        {
            bool left = side == Side.Left;
            Hand = animator.GetBoneTransform(left ? HumanBodyBones.LeftHand : HumanBodyBones.RightHand);
            LowerArm = animator.GetBoneTransform(left ? HumanBodyBones.LeftLowerArm : HumanBodyBones.RightLowerArm);
            UpperArm = animator.GetBoneTransform(left ? HumanBodyBones.LeftUpperArm : HumanBodyBones.RightUpperArm);
            HumanBodyBones first = left ? HumanBodyBones.LeftThumbProximal : HumanBodyBones.RightThumbProximal;
            for (int i = 0; i < Fingers.Length; i++) Fingers[i] = animator.GetBoneTransform(first + i);
        }

        void TakeNamed(Transform[] all, Side side, BoneMap map, bool onlyMapped)
        {
            var names = new string[all.Length];
            for (int i = 0; i < all.Length; i++) names[i] = map.NameOf(all[i].name);
            BoneIndices found = BoneFinder.Find(names, side);
            for (int finger = 0; finger < Metacarpals.Length; finger++)
                if (found.Metacarpals[finger] >= 0) Metacarpals[finger] = all[found.Metacarpals[finger]];
            if (Counts(all, found.Hand, map, onlyMapped)) Hand = all[found.Hand];
            for (int i = 0; i < Fingers.Length; i++)
                if (Counts(all, found.Fingers[i], map, onlyMapped)) Fingers[i] = all[found.Fingers[i]];
        }

        static bool Counts(Transform[] all, int found, BoneMap map, bool onlyMapped)
        {
            return found >= 0 && (!onlyMapped || map.Has(all[found].name));
        }

        /// <summary>
        /// The bones at rest in the space of the hand bone, whose axes are multiplied by `scale`: that of the hand bone for
        /// metres in the world. Bones that do not hang on the hand are left out.
        /// </summary>
        public RestHand AtRest(RestPose pose, Vector3 scale)
        {
            var rest = new RestHand();
            for (int i = 0; i < Fingers.Length; i++)
            {
                Transform bone = Fingers[i];
                if (bone == null) continue;
                rest.Present[i] = true;
                rest.Positions[i] = PositionAtRest(pose, bone, scale, out rest.Rotations[i]);
                rest.HasTip[i / 3] = FindTip(pose, bone, rest.Positions[i], scale, out rest.Tips[i / 3]);
            }
            for (int finger = 1; finger < Metacarpals.Length; finger++)
            {
                Quat turned;
                if (Metacarpals[finger] == null || !Metacarpals[finger].IsChildOf(Hand)) continue;
                rest.HasMetacarpal[finger] = true;
                rest.Metacarpals[finger] = PositionAtRest(pose, Metacarpals[finger], scale, out turned);
            }
            return rest;
        }

        /// <summary>The end of a finger's last bone is its first child at another place.</summary>
        bool FindTip(RestPose pose, Transform bone, Vec3 position, Vector3 scale, out Vec3 tip)
        {
            tip = new Vec3(0f, 0f, 0f);
            Quat turned;
            for (int i = 0; i < bone.childCount; i++)
            {
                tip = PositionAtRest(pose, bone.GetChild(i), scale, out turned);
                if ((tip - position).Length > SamePlace * position.Length) return true;
            }
            return false;
        }

        Vec3 PositionAtRest(RestPose pose, Transform bone, Vector3 scale, out Quat rotation)
        {
            Vector3 position;
            Quaternion turned;
            pose.InSpaceOf(Hand, bone, out position, out turned);
            rotation = ManipNetPose.FromUnity(turned);
            return ManipNetPose.FromUnity(Vector3.Scale(scale, position));
        }

        /// <summary>The parent of a bone inside the rig, beyond bones that only spread a twist.</summary>
        static Transform Above(Transform bone, Transform top)
        {
            Transform above = bone == null || bone == top ? null : bone.parent;
            while (above != null && above != top && above.name.ToLowerInvariant().Contains("twist")) above = above.parent;
            return above == top ? null : above;
        }
    }
}
