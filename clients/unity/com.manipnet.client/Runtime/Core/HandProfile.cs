using System;
using System.Globalization;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>
    /// One hand of a hand profile (docs/any-hand.md), made from the bones of a rig: its OpenXR joints at rest with straight
    /// fingers, in the frame of its wrist joint. It computes what `manipnet hand import` does for a rig without a skin.
    /// </summary>
    public sealed class HandProfile
    {
        const float MetacarpalBase = 0.3f, TipShare = 0.8f, ThumbBehind = 0.08f, KnucklesOffM = 0.05f;
        const int Middle = 2;
        readonly Side _side;
        readonly RestHand _rest;
        readonly Quat _toProfile;
        readonly Vec3[] _ends = new Vec3[HandRig.BoneCount];

        /// <summary>26 joints, position xyz in metres and quaternion xyzw each, in the project's axes; NaN for a missing one.</summary>
        public readonly float[] Joints = new float[7 * Layout.JointCount];

        /// <summary>The rotation from the frame of the wrist joint to the space of the hand bone, in Unity's axes.</summary>
        public readonly Quat ToHand;

        /// <summary>Throws ArgumentException for bones that are not those of a hand; the text says what to do.</summary>
        public HandProfile(Side side, RestHand rest)
        {
            _side = side;
            _rest = rest;
            _toProfile = PalmFrame();
            Quat toHand = _toProfile.Inverse;
            ToHand = side == Side.Left ? toHand : new Quat(toHand.X, -toHand.Y, -toHand.Z, toHand.W);
            for (int i = 0; i < Joints.Length; i++) Joints[i] = float.NaN;
            SetJoint(1, new Vec3(0f, 0f, 0f), Quat.Identity);
            for (int finger = 0; finger < HandRig.FingerCount; finger++) AddFinger(finger);
            SetJoint(0, 0.5f * (1f + MetacarpalBase) * PalmKnuckle(), Quat.Identity);
            if (side == Side.Left) Mirror();
        }

        /// <summary>The OpenXR joint that turns with a finger bone. A rig's first bone of the thumb is OpenXR's metacarpal.</summary>
        public static int JointOf(int bone)
        {
            return bone < 3 ? 2 + bone : 2 + 5 * (bone / 3) + bone % 3;
        }

        /// <summary>Where a finger bone of the rig ends at rest, in the space of the hand bone and Unity's axes.</summary>
        public Vec3 End(int bone)
        {
            return _ends[bone];
        }

        /// <summary>The rotation of a joint in the frame of the wrist joint, in Unity's axes.</summary>
        public Quat Rotation(int joint)
        {
            return UnityAxes.Rotation(Joints, 7 * joint + 3);
        }

        /// <summary>The profile as the request `hand_profile` wants it. A hand that is null is left out.</summary>
        public static string Json(string name, HandProfile left, HandProfile right)
        {
            var text = new StringBuilder("{\"name\": " + ControlClient.Quoted(name));
            if (left != null) text.Append(", \"left\": {\"joints\": " + left.JointsJson() + "}");
            if (right != null) text.Append(", \"right\": {\"joints\": " + right.JointsJson() + "}");
            return text.Append("}").ToString();
        }

        /// <summary>
        /// A name that may be part of a topic: that of the character, and four digits that differ for other hands and other
        /// actors, so that two characters of one name do not replace each other's profiles.
        /// </summary>
        public static string NameFor(string character, string actor, HandProfile left, HandProfile right)
        {
            var name = new StringBuilder();
            foreach (char c in character)
                if (Encoding.UTF8.GetByteCount(name.ToString()) < 50)
                    name.Append(char.IsLetterOrDigit(c) || c == '-' || c == '.' ? c : '_');
            uint hash = 2166136261;
            foreach (byte part in Encoding.UTF8.GetBytes(actor + Json("", left, right))) hash = (hash ^ part) * 16777619;
            return name + "_" + (hash >> 16 ^ hash & 0xFFFF).ToString("x4");
        }

        string JointsJson()
        {
            var rows = new string[Layout.JointCount];
            for (int joint = 0; joint < rows.Length; joint++)
            {
                var row = new string[7];
                for (int i = 0; i < 7; i++) row[i] = Joints[7 * joint + i].ToString("R", CultureInfo.InvariantCulture);
                rows[joint] = float.IsNaN(Joints[7 * joint]) ? "null" : "[" + string.Join(", ", row) + "]";
            }
            return "[" + string.Join(", ", rows) + "]";
        }

        /// <summary>A point of the rig as that of a right hand in the project's axes; a left hand is mirrored.</summary>
        Vec3 AsRight(Vec3 v)
        {
            return _side == Side.Right ? new Vec3(-v.X, v.Y, v.Z) : v;
        }

        Vec3 InProfile(Vec3 v)
        {
            return _toProfile.Rotate(AsRight(v));
        }

        /// <summary>The rotation to the frame in which the knuckles lie as the model's do.</summary>
        Quat PalmFrame()
        {
            int[] roots = Array.FindAll(new[] { 3, 6, 9, 12 }, bone => _rest.Present[bone]);
            if (roots.Length < 2 && _rest.Present[0]) roots = Append(roots, 0);
            if (roots.Length < 2) throw Refusal("has only one finger, so that its palm cannot be found; use a bone map");
            var ours = new Vec3[roots.Length];
            var theirs = new Vec3[roots.Length];
            float ourSize = 0f, theirSize = 0f;
            for (int i = 0; i < roots.Length; i++)
            {
                ours[i] = AsRight(_rest.Positions[roots[i]]);
                theirs[i] = ModelPosition(JointOf(roots[i]));
                ourSize += Vec3.Dot(ours[i], ours[i]);
                theirSize += Vec3.Dot(theirs[i], theirs[i]);
            }
            if (!(ourSize > 1e-8f)) throw Refusal("has all its fingers in one place");
            Quat turn = PointAlignment.Solve(ours, theirs);
            float scale = (float)Math.Sqrt(theirSize / ourSize), error = 0f;
            var knuckles = new Vec3(0f, 0f, 0f);
            for (int i = 0; i < roots.Length; i++)
            {
                Vec3 turned = turn.Rotate(ours[i]);
                error = Math.Max(error, (scale * turned - theirs[i]).Length);
                knuckles += 1f / roots.Length * turned;
            }
            if (error > KnucklesOffM)
                throw Refusal("has knuckles that do not lie side by side; check the names of its bones, or use a bone map");
            CheckThumb(turn, knuckles);
            return turn;
        }

        static int[] Append(int[] list, int last)
        {
            Array.Resize(ref list, list.Length + 1);
            list[list.Length - 1] = last;
            return list;
        }

        /// <summary>The thumb tells a hand from its mirror image, whose knuckles lie alike.</summary>
        void CheckThumb(Quat turn, Vec3 knuckles)
        {
            int last = _rest.Present[2] ? 2 : _rest.Present[1] ? 1 : _rest.Present[0] ? 0 : -1;
            if (last < 0) return;
            Vec3 tip = turn.Rotate(AsRight(_rest.Positions[last]));
            if (tip.X > knuckles.X || tip.Y > knuckles.Y + ThumbBehind * knuckles.Length)
                throw Refusal("has its thumb on the wrong side, so that it is the other hand or a mirrored one; correct the side or the negative scale");
        }

        ArgumentException Refusal(string what)
        {
            return new ArgumentException("the " + (_side == Side.Left ? "left" : "right") + " hand " + what);
        }

        void AddFinger(int finger)
        {
            int[] chain = Array.FindAll(new[] { 3 * finger, 3 * finger + 1, 3 * finger + 2 }, bone => _rest.Present[bone]);
            if (chain.Length == 0) return;
            var points = new Vec3[chain.Length + 1];
            for (int i = 0; i < chain.Length; i++) points[i] = InProfile(_rest.Positions[chain[i]]);
            points[chain.Length] = Tip(finger, chain, points);
            for (int i = 0; i < chain.Length; i++) _ends[chain[i]] = AsRight(_toProfile.Inverse.Rotate(points[i + 1]));
            Vec3 along = (points[1] - points[0]).Normalized, at = points[0];
            Quat frame = Frame(JointOf(chain[0]), along);
            for (int i = 0; i < chain.Length; i++)
            {
                SetJoint(JointOf(chain[i]), at, frame);
                at += (points[i + 1] - points[i]).Length * along;
            }
            SetJoint(5 + 5 * finger, at, frame);
            if (finger == 0) return;
            Vec3 root = _rest.HasMetacarpal[finger] ? InProfile(_rest.Metacarpals[finger]) : MetacarpalBase * points[0];
            SetJoint(1 + 5 * finger, root, Quat.Identity);
        }

        Vec3 Tip(int finger, int[] chain, Vec3[] points)
        {
            if (_rest.HasTip[finger]) return InProfile(_rest.Tips[finger]);
            int last = chain.Length - 1;
            Vec3 before = last > 0 ? points[last] - points[last - 1] : new Vec3(0f, 0f, -0.03f);
            return points[last] + TipShare * before;
        }

        /// <summary>The frame of a straight finger: -z along it, and +y out of its back, as on the model's finger.</summary>
        static Quat Frame(int joint, Vec3 along)
        {
            var model = ModelRotation(joint);
            Vec3 theirs = model.Rotate(new Vec3(0f, 0f, -1f));
            Vec3 back = Quat.FromTo(theirs, along).Rotate(model.Rotate(new Vec3(0f, 1f, 0f)));
            Quat first = Quat.FromTo(new Vec3(0f, 0f, -1f), along);
            Vec3 up = first.Rotate(new Vec3(0f, 1f, 0f));
            double half = 0.5 * Math.Atan2(Vec3.Dot(Vec3.Cross(up, back), along), Vec3.Dot(up, back));
            float sine = (float)Math.Sin(half);
            return (new Quat(sine * along.X, sine * along.Y, sine * along.Z, (float)Math.Cos(half)) * first).Normalized;
        }

        static Vec3 ModelPosition(int joint)
        {
            float[] x = Layout.RestJoints;
            return new Vec3(x[7 * joint], x[7 * joint + 1], x[7 * joint + 2]);
        }

        static Quat ModelRotation(int joint)
        {
            float[] x = Layout.RestJoints;
            return new Quat(x[7 * joint + 3], x[7 * joint + 4], x[7 * joint + 5], x[7 * joint + 6]);
        }

        /// <summary>The knuckle of the middle finger, or the mean of the others where it is missing.</summary>
        Vec3 PalmKnuckle()
        {
            var sum = new Vec3(0f, 0f, 0f);
            int count = 0;
            for (int finger = 1; finger < HandRig.FingerCount; finger++)
            {
                int at = 7 * JointOf(3 * finger);
                if (float.IsNaN(Joints[at])) continue;
                var knuckle = new Vec3(Joints[at], Joints[at + 1], Joints[at + 2]);
                if (finger == Middle) return knuckle;
                sum += knuckle;
                count++;
            }
            return 1f / Math.Max(count, 1) * sum;
        }

        void SetJoint(int joint, Vec3 p, Quat q)
        {
            float[] values = { p.X, p.Y, p.Z, q.X, q.Y, q.Z, q.W };
            values.CopyTo(Joints, 7 * joint);
        }

        void Mirror()
        {
            for (int at = 0; at < Joints.Length; at += 7)
                foreach (int mirrored in new[] { 0, 4, 5 })
                    Joints[at + mirrored] = -Joints[at + mirrored];
        }
    }
}
