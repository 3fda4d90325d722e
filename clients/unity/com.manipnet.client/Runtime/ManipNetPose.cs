using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Converts from the project's axes (right-handed, Y up, metres) to Unity's (left-handed) by reversing x.
    /// </summary>
    public static class ManipNetPose
    {
        /// <summary>
        /// The rotation from OpenXR's joints, whose -z points to the finger tip, to XR Hands', whose +z does.
        /// </summary>
        public static readonly Quaternion ForwardAlongBone = new Quaternion(0f, 1f, 0f, 0f);

        /// <summary>The position of the pose that begins at values[at].</summary>
        public static Vector3 Position(float[] values, int at)
        {
            return ToUnity(UnityAxes.Position(values, at));
        }

        /// <summary>The rotation of the pose that begins at values[at].</summary>
        public static Quaternion Rotation(float[] values, int at)
        {
            return ToUnity(UnityAxes.Rotation(values, at + 3));
        }

        public static Vector3 ToUnity(Vec3 v)
        {
            return new Vector3(v.X, v.Y, v.Z);
        }

        public static Quaternion ToUnity(Quat q)
        {
            return new Quaternion(q.X, q.Y, q.Z, q.W);
        }

        public static Vec3 FromUnity(Vector3 v)
        {
            return new Vec3(v.x, v.y, v.z);
        }

        public static Quat FromUnity(Quaternion q)
        {
            return new Quat(q.x, q.y, q.z, q.w);
        }
    }
}
