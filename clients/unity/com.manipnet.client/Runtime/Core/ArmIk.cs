using System;

namespace ManipNet.Client
{
    /// <summary>
    /// Turns an arm of two bones so that its wrist arrives at a target. The elbow stays in the plane in which it was, and
    /// a target that is out of reach is approached with a straight arm.
    /// </summary>
    public static class ArmIk
    {
        /// <summary>
        /// Computes rotations that come before (to the left of) those that the upper and the lower arm have in the world.
        /// </summary>
        public static void Solve(Vec3 shoulder, Vec3 elbow, Vec3 wrist, Vec3 target, out Quat upperTurn, out Quat lowerTurn)
        {
            float upper = (elbow - shoulder).Length, lower = (wrist - elbow).Length;
            Vec3 along = (target - shoulder).Normalized;
            float reach = Math.Min(Math.Max((target - shoulder).Length, Math.Abs(upper - lower)), upper + lower);
            Quat swing = Quat.FromTo(wrist - shoulder, target - shoulder);
            Vec3 swung = swing.Rotate(elbow - shoulder);
            Vec3 aside = swung - Vec3.Dot(swung, along) * along;
            Vec3 bend = aside.Length > 1e-4f * upper ? aside.Normalized : AnyAcross(along);
            float forth = reach > 0f ? (upper * upper - lower * lower + reach * reach) / (2f * reach) : 0f;
            float aslant = (float)Math.Sqrt(Math.Max(upper * upper - forth * forth, 0f));
            Vec3 newElbow = forth * along + aslant * bend; // relative to the shoulder
            upperTurn = Quat.FromTo(swung, newElbow) * swing;
            lowerTurn = Quat.FromTo(upperTurn.Rotate(wrist - elbow), reach * along - newElbow) * upperTurn;
        }

        /// <summary>A direction in which the elbow of a straight arm bends: any one across the arm.</summary>
        static Vec3 AnyAcross(Vec3 along)
        {
            return Vec3.Cross(along, Math.Abs(along.Y) < 0.7f ? new Vec3(0f, 1f, 0f) : new Vec3(1f, 0f, 0f)).Normalized;
        }
    }
}
