using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// The rest pose of a rig: that of a Humanoid's Avatar, whatever pose the rig is in. Bones that no Avatar describes
    /// rest as they are now.
    /// </summary>
    public sealed class RestPose
    {
        readonly Dictionary<string, SkeletonBone> _bones = new Dictionary<string, SkeletonBone>();

        /// <param name="animator">The Humanoid; may be null.</param>
        public RestPose(Animator animator)
        {
            if (animator == null || !animator.isHuman || animator.avatar == null) return;
            foreach (SkeletonBone bone in animator.avatar.humanDescription.skeleton) _bones[bone.name] = bone;
        }

        /// <summary>The pose at rest of a bone in the space of an ancestor of it.</summary>
        public void InSpaceOf(Transform ancestor, Transform bone, out Vector3 position, out Quaternion rotation)
        {
            position = Vector3.zero;
            rotation = Quaternion.identity;
            for (Transform t = bone; t != ancestor && t != null; t = t.parent)
            {
                SkeletonBone described;
                bool known = _bones.TryGetValue(t.name, out described);
                Quaternion turn = known ? described.rotation : t.localRotation;
                Vector3 scaled = Vector3.Scale(known ? described.scale : t.localScale, position);
                position = (known ? described.position : t.localPosition) + turn * scaled;
                rotation = turn * rotation;
            }
        }
    }
}
