namespace ManipNet.Client
{
    /// <summary>
    /// Poses the finger bones of the rig on which the server has solved the hand, so that every joint of the rig is where
    /// the message says. The bones may have any axes. All results are in Unity's axes.
    /// </summary>
    public sealed class AvatarRig
    {
        readonly Quat[] _bind = new Quat[HandRig.BoneCount];
        readonly bool[] _present;

        /// <summary>The profile to upload for this hand.</summary>
        public readonly HandProfile Profile;

        /// <summary>Throws ArgumentException for bones that are not those of a hand.</summary>
        public AvatarRig(Side side, RestHand rest)
        {
            Profile = new HandProfile(side, rest);
            _present = rest.Present;
            for (int bone = 0; bone < _bind.Length; bone++)
            {
                if (!_present[bone]) continue;
                Quat frame = Profile.ToHand * Profile.Rotation(HandProfile.JointOf(bone));
                Vec3 along = frame.Rotate(new Vec3(0f, 0f, -1f)); // the profile's fingers are straight; the rig's need not be
                _bind[bone] = frame.Inverse * Quat.FromTo(Profile.End(bone) - rest.Positions[bone], along) * rest.Rotations[bone];
            }
        }

        /// <summary>The position of the hand bone in the world.</summary>
        public Vec3 HandPosition(HandFrame hand)
        {
            return UnityAxes.Position(hand.Joints, 7);
        }

        /// <summary>The rotation of the hand bone in the world.</summary>
        public Quat HandRotation(HandFrame hand)
        {
            return (UnityAxes.Rotation(hand.Joints, 10) * Profile.ToHand.Inverse).Normalized;
        }

        /// <summary>
        /// Computes the rotations of the 15 finger bones in the space of the hand bone; those of bones that the rig lacks mean
        /// nothing.
        /// </summary>
        public void Solve(HandFrame hand, Quat[] output)
        {
            Quat toHand = Profile.ToHand * UnityAxes.Rotation(hand.Joints, 10).Inverse;
            for (int bone = 0; bone < _bind.Length; bone++)
            {
                if (!_present[bone]) continue;
                Quat joint = UnityAxes.Rotation(hand.Joints, 7 * HandProfile.JointOf(bone) + 3);
                output[bone] = (toHand * joint * _bind[bone]).Normalized;
            }
        }
    }
}
