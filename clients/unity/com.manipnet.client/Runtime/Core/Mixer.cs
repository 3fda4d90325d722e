using System;

namespace ManipNet.Client
{
    /// <summary>Computes weighted means of frames; quaternions are summed and normalised. Allocates nothing.</summary>
    public sealed class Mixer
    {
        readonly float[][] _sources;
        readonly double[] _weights;
        int _count;

        public Mixer(int capacity)
        {
            _sources = new float[capacity][];
            _weights = new double[capacity];
        }

        /// <summary>
        /// Writes the mean to `output`; names, states and the like come from the frame in the slot `reference`.
        /// </summary>
        public void Mix(HandsFrame[] frames, double[] weights, int reference, HandsFrame output)
        {
            output.CopyFrom(frames[reference]);
            MixHand(frames, weights, Side.Left, output.Left);
            MixHand(frames, weights, Side.Right, output.Right);
            for (int i = 0; i < output.BodyCount; i++)
                if (GatherBody(frames, weights, i, output.Body(i).Name))
                    Poses(output.Body(i).Pose);
        }

        void MixHand(HandsFrame[] frames, double[] weights, Side side, HandFrame output)
        {
            if (!output.Present) return;
            for (int k = 0; k < frames.Length; k++)
                if (weights[k] != 0.0 && !frames[k].Hand(side).Present) return; // it appears or disappears here, so it is not in all frames
            GatherHand(frames, weights, side, 0);
            Numbers(output.Angles);
            GatherHand(frames, weights, side, 1);
            Quaternions(output.Rotations, 0, 4);
            GatherHand(frames, weights, side, 2);
            Poses(output.Wrist);
            GatherHand(frames, weights, side, 3);
            Poses(output.Joints);
        }

        void GatherHand(HandsFrame[] frames, double[] weights, Side side, int field)
        {
            _count = 0;
            for (int k = 0; k < frames.Length; k++)
            {
                if (weights[k] == 0.0) continue;
                HandFrame hand = frames[k].Hand(side);
                float[] source = field == 0 ? hand.Angles : field == 1 ? hand.Rotations : field == 2 ? hand.Wrist : hand.Joints;
                Gather(source, weights[k]);
            }
        }

        bool GatherBody(HandsFrame[] frames, double[] weights, int index, FixedName name)
        {
            _count = 0;
            for (int k = 0; k < frames.Length; k++)
            {
                if (weights[k] == 0.0) continue;
                if (index >= frames[k].BodyCount || !frames[k].Body(index).Name.SameAs(name)) return false;
                Gather(frames[k].Body(index).Pose, weights[k]);
            }
            return true;
        }

        void Gather(float[] source, double weight)
        {
            _sources[_count] = source;
            _weights[_count++] = weight;
        }

        void Numbers(float[] output)
        {
            for (int i = 0; i < output.Length; i++) output[i] = Sum(i);
        }

        void Poses(float[] output)
        {
            for (int i = 0; i < output.Length; i += 7)
                for (int j = i; j < i + 3; j++)
                    output[j] = Sum(j);
            Quaternions(output, 3, 7);
        }

        float Sum(int index)
        {
            double sum = 0.0;
            for (int k = 0; k < _count; k++) sum += _weights[k] * _sources[k][index];
            return (float)sum;
        }

        /// <summary>
        /// Sums quaternions, each with the sign that is nearer to the reference, which `output` still holds.
        /// </summary>
        void Quaternions(float[] output, int first, int stride)
        {
            for (int i = first; i < output.Length; i += stride)
            {
                double x = 0.0, y = 0.0, z = 0.0, w = 0.0;
                for (int k = 0; k < _count; k++)
                {
                    float[] q = _sources[k];
                    double dot = q[i] * output[i] + q[i + 1] * output[i + 1] + q[i + 2] * output[i + 2] + q[i + 3] * output[i + 3];
                    double weight = dot < 0.0 ? -_weights[k] : _weights[k];
                    x += weight * q[i];
                    y += weight * q[i + 1];
                    z += weight * q[i + 2];
                    w += weight * q[i + 3];
                }
                double length = Math.Sqrt(x * x + y * y + z * z + w * w);
                if (length < 1e-6) continue;
                output[i] = (float)(x / length);
                output[i + 1] = (float)(y / length);
                output[i + 2] = (float)(z / length);
                output[i + 3] = (float)(w / length);
            }
        }
    }
}
