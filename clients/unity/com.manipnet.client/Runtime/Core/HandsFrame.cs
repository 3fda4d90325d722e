using System;

namespace ManipNet.Client
{
    public enum Side { Left = 0, Right = 1 }

    public enum HandState { Live = 0, Hold = 1, Rest = 2 }

    /// <summary>One hand in the project's axes: right-handed, Y up, metres, quaternions xyzw.</summary>
    public sealed class HandFrame
    {
        public bool Present;
        public HandState State;
        public bool HasObject;
        public readonly FixedName Object = new FixedName();
        public float Scale = 1f;

        /// <summary>20 joint angles, radians, in the order of Layout.AngleNames.</summary>
        public readonly float[] Angles = new float[Layout.AngleCount];

        /// <summary>17 quaternions relative to the parent bone, in the order of Layout.BoneNames.</summary>
        public readonly float[] Rotations = new float[4 * Layout.BoneCount];

        /// <summary>The position and quaternion of the wrist in the world.</summary>
        public readonly float[] Wrist = new float[7];

        /// <summary>The position and quaternion of each of 26 OpenXR joints in the world.</summary>
        public readonly float[] Joints = new float[7 * Layout.JointCount];

        public void CopyFrom(HandFrame other)
        {
            Present = other.Present;
            State = other.State;
            HasObject = other.HasObject;
            Object.CopyFrom(other.Object);
            Scale = other.Scale;
            Array.Copy(other.Angles, Angles, Angles.Length);
            Array.Copy(other.Rotations, Rotations, Rotations.Length);
            Array.Copy(other.Wrist, Wrist, Wrist.Length);
            Array.Copy(other.Joints, Joints, Joints.Length);
        }
    }

    /// <summary>A tracked body with its position and quaternion in the world.</summary>
    public sealed class BodyFrame
    {
        public readonly FixedName Name = new FixedName();
        public bool Tracked;
        public readonly float[] Pose = new float[7];

        public void CopyFrom(BodyFrame other)
        {
            Name.CopyFrom(other.Name);
            Tracked = other.Tracked;
            Array.Copy(other.Pose, Pose, Pose.Length);
        }
    }

    /// <summary>One message, in memory that is reused.</summary>
    public sealed class HandsFrame
    {
        public readonly FixedName Session = new FixedName();
        public readonly FixedName Actor = new FixedName();
        public ulong Seq;
        public double TCapture;
        public double TPublish;
        public double LookAhead;

        /// <summary>The times buffer, sense, infer, ik and total, in milliseconds.</summary>
        public readonly float[] LatencyMs = new float[5];

        /// <summary>The SMPTE timecode HH:MM:SS:FF of the instant; empty if the tracker sends none.</summary>
        public readonly FixedName Timecode = new FixedName();

        /// <summary>The timecode's frames per second; 0 if it is not known.</summary>
        public float TimecodeRate;

        public readonly HandFrame Left = new HandFrame();
        public readonly HandFrame Right = new HandFrame();
        public int BodyCount { get; private set; }
        BodyFrame[] _bodies = new BodyFrame[0];

        public HandFrame Hand(Side side)
        {
            return side == Side.Left ? Left : Right;
        }

        public BodyFrame Body(int index)
        {
            return _bodies[index];
        }

        /// <summary>Sets the number of bodies. Allocates only if there have never been as many.</summary>
        public void SetBodyCount(int count)
        {
            if (count > _bodies.Length)
            {
                int known = _bodies.Length;
                Array.Resize(ref _bodies, count);
                for (int i = known; i < count; i++) _bodies[i] = new BodyFrame();
            }
            BodyCount = count;
        }

        public void CopyFrom(HandsFrame other)
        {
            Session.CopyFrom(other.Session);
            Actor.CopyFrom(other.Actor);
            Seq = other.Seq;
            TCapture = other.TCapture;
            TPublish = other.TPublish;
            LookAhead = other.LookAhead;
            Array.Copy(other.LatencyMs, LatencyMs, LatencyMs.Length);
            Timecode.CopyFrom(other.Timecode);
            TimecodeRate = other.TimecodeRate;
            Left.CopyFrom(other.Left);
            Right.CopyFrom(other.Right);
            SetBodyCount(other.BodyCount);
            for (int i = 0; i < BodyCount; i++) _bodies[i].CopyFrom(other._bodies[i]);
        }
    }
}
