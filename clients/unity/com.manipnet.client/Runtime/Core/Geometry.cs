using System;

namespace ManipNet.Client
{
    /// <summary>A vector, like Unity's Vector3 but without the engine.</summary>
    public struct Vec3
    {
        public float X, Y, Z;

        public Vec3(float x, float y, float z)
        {
            X = x;
            Y = y;
            Z = z;
        }

        public static Vec3 operator +(Vec3 a, Vec3 b)
        {
            return new Vec3(a.X + b.X, a.Y + b.Y, a.Z + b.Z);
        }

        public static Vec3 operator -(Vec3 a, Vec3 b)
        {
            return new Vec3(a.X - b.X, a.Y - b.Y, a.Z - b.Z);
        }

        public static Vec3 operator *(float s, Vec3 v)
        {
            return new Vec3(s * v.X, s * v.Y, s * v.Z);
        }

        public static float Dot(Vec3 a, Vec3 b)
        {
            return a.X * b.X + a.Y * b.Y + a.Z * b.Z;
        }

        public static Vec3 Cross(Vec3 a, Vec3 b)
        {
            return new Vec3(a.Y * b.Z - a.Z * b.Y, a.Z * b.X - a.X * b.Z, a.X * b.Y - a.Y * b.X);
        }

        public float Length
        {
            get { return (float)Math.Sqrt(Dot(this, this)); }
        }

        public Vec3 Normalized
        {
            get { return (1f / Math.Max(Length, 1e-12f)) * this; }
        }
    }

    /// <summary>A unit quaternion, like Unity's Quaternion but without the engine.</summary>
    public struct Quat
    {
        public float X, Y, Z, W;

        public Quat(float x, float y, float z, float w)
        {
            X = x;
            Y = y;
            Z = z;
            W = w;
        }

        public static readonly Quat Identity = new Quat(0f, 0f, 0f, 1f);

        public Quat Inverse
        {
            get { return new Quat(-X, -Y, -Z, W); }
        }

        /// <summary>The rotation b followed by a.</summary>
        public static Quat operator *(Quat a, Quat b)
        {
            return new Quat(
                a.W * b.X + a.X * b.W + a.Y * b.Z - a.Z * b.Y,
                a.W * b.Y - a.X * b.Z + a.Y * b.W + a.Z * b.X,
                a.W * b.Z + a.X * b.Y - a.Y * b.X + a.Z * b.W,
                a.W * b.W - a.X * b.X - a.Y * b.Y - a.Z * b.Z);
        }

        public Vec3 Rotate(Vec3 v)
        {
            var u = new Vec3(X, Y, Z);
            Vec3 t = 2f * Vec3.Cross(u, v);
            return v + W * t + Vec3.Cross(u, t);
        }

        /// <summary>The shortest rotation from one direction to another.</summary>
        public static Quat FromTo(Vec3 from, Vec3 to)
        {
            from = from.Normalized;
            to = to.Normalized;
            float w = 1f + Vec3.Dot(from, to);
            Vec3 axis = Vec3.Cross(from, to);
            if (w < 1e-6f) // opposite directions: half a turn about any perpendicular axis
            {
                axis = Vec3.Cross(from, Math.Abs(from.X) < 0.7f ? new Vec3(1f, 0f, 0f) : new Vec3(0f, 1f, 0f));
                w = 0f;
            }
            return new Quat(axis.X, axis.Y, axis.Z, w).Normalized;
        }

        public Quat Normalized
        {
            get
            {
                float s = 1f / (float)Math.Sqrt(X * X + Y * Y + Z * Z + W * W);
                return new Quat(s * X, s * Y, s * Z, s * W);
            }
        }
    }

    /// <summary>
    /// Converts from the project's axes (right-handed, Y up, metres) to Unity's (left-handed) by reversing x.
    /// </summary>
    public static class UnityAxes
    {
        public static Vec3 Position(float[] values, int at)
        {
            return new Vec3(-values[at], values[at + 1], values[at + 2]);
        }

        public static Quat Rotation(float[] values, int at)
        {
            return new Quat(values[at], -values[at + 1], -values[at + 2], values[at + 3]);
        }
    }
}
