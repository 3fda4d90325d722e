using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>The bones of one hand of a rig, and of the arm it hangs on. A bone that the rig lacks is null.</summary>
    public sealed class HandBones
    {
        public Transform Hand, LowerArm, UpperArm;

        /// <summary>15 finger bones, thumb to little finger, proximal to distal.</summary>
        public readonly Transform[] Fingers = new Transform[HandRig.BoneCount];

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
            bool metacarpal = false;
            foreach (Transform t in all) metacarpal |= RigNames.IsThumbMetacarpal(map.NameOf(t.name), side);
            foreach (Transform t in all)
            {
                if (onlyMapped && !map.Has(t.name)) continue;
                string name = map.NameOf(t.name);
                if (RigNames.IsHand(name, side)) Hand = t;
                for (int i = 0; i < Fingers.Length; i++)
                    if (RigNames.Matches(name, side, i / 3, i % 3, metacarpal)) Fingers[i] = t;
            }
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
