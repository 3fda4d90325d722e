using System;

namespace ManipNet.Client
{
    /// <summary>
    /// Poses the finger bones of any rig. Its bones may have any axes and lengths, because only their directions in the
    /// bind pose are used. All poses are in the space of the rig's hand bone, in Unity's axes.
    /// </summary>
    public sealed class HandRig
    {
        public const int BoneCount = 15, FingerCount = 5;
        public static readonly string[] Fingers = { "Thumb", "Index", "Middle", "Ring", "Little" };
        public static readonly string[] Parts = { "Proximal", "Intermediate", "Distal" };
        static readonly int[] Parents = { -1, 0, 1, 2, 3, 0, 5, 6, 0, 8, 9, 0, 11, 12, 0, 14, 15 };
        readonly Quat[] _world = new Quat[Layout.BoneCount];
        readonly Quat[] _bind = new Quat[BoneCount];
        readonly Quat _wristToHand;

        /// <param name="side">The side of the rig's hand.</param>
        /// <param name="positions">15 bind positions, thumb to little finger, proximal to distal.</param>
        /// <param name="rotations">15 bind rotations in the same order.</param>
        /// <param name="tips">5 ends of the fingers' last bones in the bind pose.</param>
        /// <param name="correctRestPose">Whether bones point where the hand's do, or only turn as much.</param>
        /// <param name="present">Which of the 15 bones the rig has; null for all of them.</param>
        public HandRig(Side side, Vec3[] positions, Quat[] rotations, Vec3[] tips, bool correctRestPose = true, bool[] present = null)
        {
            bool[] has = present ?? AllBones();
            _wristToHand = Align(side, positions, has);
            for (int i = 0; i < BoneCount; i++)
            {
                _bind[i] = Quat.Identity;
                if (!has[i]) continue;
                int next = i + 1;
                while (next % 3 != 0 && !has[next]) next++;
                bool last = next % 3 == 0;
                Vec3 end = last ? tips[i / 3] : positions[next];
                Vec3 ours = ZeroPosition(side, last ? JointAfter(i) : OurBone(next)) - ZeroPosition(side, OurBone(i));
                Quat turn = correctRestPose ? Quat.FromTo(end - positions[i], _wristToHand.Rotate(ours)) : Quat.Identity;
                _bind[i] = ZeroRotation(side, OurBone(i)).Inverse * _wristToHand.Inverse * turn * rotations[i];
            }
        }

        static bool[] AllBones()
        {
            var all = new bool[BoneCount];
            for (int i = 0; i < BoneCount; i++) all[i] = true;
            return all;
        }

        /// <summary>
        /// The rotation from the frame of our wrist to that of the rig's hand bone. The first bones of the middle, index and
        /// little finger define it, or others where these are missing.
        /// </summary>
        static Quat Align(Side side, Vec3[] positions, bool[] has)
        {
            int along = 0, first = -1, last = -1;
            foreach (int bone in new[] { 12, 9, 3, 6 })
                if (has[bone]) along = bone;
            for (int bone = 3; bone < BoneCount; bone += 3)
            {
                if (!has[bone]) continue;
                if (first < 0) first = bone;
                last = bone;
            }
            if (first == last && has[0]) first = 0;
            Vec3 ours = ZeroPosition(side, OurBone(along));
            if (first == last || last < 0) return Quat.FromTo(ours, positions[along]);
            return Frame(positions[along], positions[first] - positions[last])
                * Frame(ours, ZeroPosition(side, OurBone(first)) - ZeroPosition(side, OurBone(last))).Inverse;
        }

        /// <summary>The rotation of the rig's hand bone that follows the tracked wrist.</summary>
        public Quat HandRotation(HandFrame hand)
        {
            return UnityAxes.Rotation(hand.Wrist, 3) * _wristToHand.Inverse;
        }

        /// <summary>
        /// Computes the rotations of the 15 finger bones in the space of the rig's hand bone; those of bones that the rig
        /// lacks mean nothing.
        /// </summary>
        public void Solve(HandFrame hand, Quat[] output)
        {
            _world[0] = _wristToHand;
            for (int i = 1; i < Layout.BoneCount; i++)
                _world[i] = _world[Parents[i]] * UnityAxes.Rotation(hand.Rotations, 4 * i);
            for (int i = 0; i < BoneCount; i++) output[i] = (_world[OurBone(i)] * _bind[i]).Normalized;
        }

        /// <summary>
        /// The hand's bone for a finger bone of the rig. Unity's ThumbProximal combines the two carpal angles of the
        /// thumb, so the thumb begins one bone later.
        /// </summary>
        static int OurBone(int i)
        {
            return 2 + i;
        }

        /// <summary>The joint at the end of a bone: the next bone, or the finger's tip.</summary>
        static int JointAfter(int i)
        {
            return i % 3 == 2 ? Layout.BoneCount + i / 3 : OurBone(i) + 1;
        }

        /// <summary>
        /// The stored pose is a right hand in the project's axes. Converting to Unity's axes mirrors it, as does a left
        /// hand.
        /// </summary>
        static Vec3 ZeroPosition(Side side, int joint)
        {
            float[] p = Layout.ZeroPositions;
            int at = 3 * joint;
            return side == Side.Right ? UnityAxes.Position(p, at) : new Vec3(p[at], p[at + 1], p[at + 2]);
        }

        static Quat ZeroRotation(Side side, int bone)
        {
            float[] q = Layout.ZeroRotations;
            int at = 4 * bone;
            return side == Side.Right ? UnityAxes.Rotation(q, at) : new Quat(q[at], q[at + 1], q[at + 2], q[at + 3]);
        }

        /// <summary>The rotation of a frame with x along `along` and y towards `across`.</summary>
        static Quat Frame(Vec3 along, Vec3 across)
        {
            Quat first = Quat.FromTo(new Vec3(1f, 0f, 0f), along);
            Vec3 wanted = across - Vec3.Dot(across, along.Normalized) * along.Normalized;
            Vec3 local = first.Inverse.Rotate(wanted);
            float angle = (float)Math.Atan2(local.Z, local.Y);
            return first * new Quat((float)Math.Sin(0.5f * angle), 0f, 0f, (float)Math.Cos(0.5f * angle));
        }
    }
}
