namespace ManipNet.Client
{
    /// <summary>
    /// The bones of one hand of a rig in its rest pose, in the space of the hand bone: metres, in Unity's axes. Finger bones
    /// run from the thumb to the little finger, proximal to distal.
    /// </summary>
    public sealed class RestHand
    {
        /// <summary>Which of the 15 finger bones the rig has.</summary>
        public readonly bool[] Present = new bool[HandRig.BoneCount];
        public readonly Vec3[] Positions = new Vec3[HandRig.BoneCount];
        public readonly Quat[] Rotations = new Quat[HandRig.BoneCount];

        /// <summary>Whether the rig shows where a finger's last bone ends, and where that is.</summary>
        public readonly bool[] HasTip = new bool[HandRig.FingerCount];
        public readonly Vec3[] Tips = new Vec3[HandRig.FingerCount];

        /// <summary>The bones in the palm that lead to the fingers; the thumb has no entry of its own.</summary>
        public readonly bool[] HasMetacarpal = new bool[HandRig.FingerCount];
        public readonly Vec3[] Metacarpals = new Vec3[HandRig.FingerCount];
    }
}
