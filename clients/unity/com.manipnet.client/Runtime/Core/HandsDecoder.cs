using System;

namespace ManipNet.Client
{
    /// <summary>
    /// Decodes the payload of `pose/bin`, which docs/protocol.md describes. Allocates only to explain a refusal.
    /// </summary>
    public static class HandsDecoder
    {
        /// <summary>
        /// Fills the frame and returns null, or returns what is wrong and leaves the frame in an undefined state.
        /// </summary>
        public static string Decode(byte[] data, int start, int length, HandsFrame frame)
        {
            if (length < Layout.HeaderBytes || BitConverter.ToInt32(data, start) != Layout.Magic)
                return "the message is not pose/bin; it must begin with MNPL and a complete header";
            int version = U16(data, start + Layout.HeaderVersion);
            if (version != Layout.Version)
                return "the message has version " + version + "; this client understands version " + Layout.Version;
            int headerSize = U16(data, start + Layout.HeaderHeaderSize);
            int handSize = U16(data, start + Layout.HeaderHandSize);
            int bodySize = U16(data, start + Layout.HeaderBodySize);
            int hands = U16(data, start + Layout.HeaderHandCount);
            int bodies = U16(data, start + Layout.HeaderBodyCount);
            if (headerSize < Layout.HeaderBytes || handSize < Layout.HandBytes || bodySize < Layout.BodyBytes)
                return "a record is shorter than its fields";
            if (hands > 2 || bodies > Layout.MaxBodies)
                return "the message has " + hands + " hands and " + bodies + " bodies; at most 2 and " + Layout.MaxBodies + " are allowed";
            int total = headerSize + hands * handSize + bodies * bodySize;
            if (length != total || BitConverter.ToUInt32(data, start + Layout.HeaderTotalSize) != total)
                return "the message has " + length + " bytes, but its header says " + total;

            string error = Header(data, start, frame) ?? Timecode(data, start, headerSize, frame);
            int at = start + headerSize;
            for (int i = 0; error == null && i < hands; i++, at += handSize) error = Hand(data, at, frame);
            frame.SetBodyCount(error == null ? bodies : 0);
            for (int i = 0; error == null && i < bodies; i++, at += bodySize) error = Body(data, at, frame.Body(i));
            return error;
        }

        static string Header(byte[] data, int at, HandsFrame frame)
        {
            frame.Seq = BitConverter.ToUInt64(data, at + Layout.HeaderSeq);
            frame.TCapture = BitConverter.ToDouble(data, at + Layout.HeaderTCapture);
            frame.TPublish = BitConverter.ToDouble(data, at + Layout.HeaderTPublish);
            frame.LookAhead = BitConverter.ToDouble(data, at + Layout.HeaderLookAhead);
            frame.Left.Present = frame.Right.Present = false;
            double times = frame.TCapture + frame.TPublish + frame.LookAhead;
            if (!IsFinite(times) || !Floats(data, at + Layout.HeaderLatencyMs, frame.LatencyMs))
                return "the header has a number that is not finite";
            if (!frame.Session.Read(data, at + Layout.HeaderSession) || !frame.Actor.Read(data, at + Layout.HeaderActor))
                return "the name of the session or the actor is too long or not UTF-8";
            return null;
        }

        /// <summary>Reads the timecode behind the header's older fields; a shorter header has none.</summary>
        static string Timecode(byte[] data, int at, int headerSize, HandsFrame frame)
        {
            frame.Timecode.Clear();
            frame.TimecodeRate = 0f;
            if (headerSize < Layout.TimedHeaderBytes) return null;
            frame.TimecodeRate = BitConverter.ToSingle(data, at + Layout.HeaderTimecodeRate);
            if (!frame.Timecode.Read(data, at + Layout.HeaderTimecode)) return "the timecode is too long or not UTF-8";
            return IsFinite(frame.TimecodeRate) ? null : "the rate of the timecode is not finite";
        }

        static string Hand(byte[] data, int at, HandsFrame frame)
        {
            int side = data[at + Layout.HandSide];
            int state = data[at + Layout.HandState];
            if (side > 1) return "the side is " + side + "; allowed are 0 (left) and 1 (right)";
            if (state > 2) return "the state is " + state + "; allowed are 0 (live), 1 (hold) and 2 (rest)";
            HandFrame hand = frame.Hand((Side)side);
            if (hand.Present) return "the same hand occurs twice; it may occur once";
            hand.Present = true;
            hand.State = (HandState)state;
            hand.HasObject = data[at + Layout.HandHasObject] != 0;
            if (!hand.Object.Read(data, at + Layout.HandObject)) return "the object's name is too long or not UTF-8";
            hand.Scale = BitConverter.ToSingle(data, at + Layout.HandScale);
            bool finite = IsFinite(hand.Scale)
                & Floats(data, at + Layout.HandAngles, hand.Angles)
                & Floats(data, at + Layout.HandRotations, hand.Rotations)
                & Floats(data, at + Layout.HandWrist, hand.Wrist)
                & Floats(data, at + Layout.HandJoints, hand.Joints);
            return finite ? null : "a hand has a number that is not finite";
        }

        static string Body(byte[] data, int at, BodyFrame body)
        {
            body.Tracked = data[at + Layout.BodyTracked] != 0;
            if (!body.Name.Read(data, at + Layout.BodyName)) return "a body's name is too long or not UTF-8";
            return Floats(data, at + Layout.BodyPose, body.Pose) ? null : "a body has a number that is not finite";
        }

        static bool Floats(byte[] data, int at, float[] into)
        {
            Buffer.BlockCopy(data, at, into, 0, 4 * into.Length);
            bool finite = true;
            for (int i = 0; i < into.Length; i++) finite &= IsFinite(into[i]);
            return finite;
        }

        static bool IsFinite(double x)
        {
            return x - x == 0.0;
        }

        static int U16(byte[] data, int at)
        {
            return data[at] | data[at + 1] << 8;
        }
    }
}
