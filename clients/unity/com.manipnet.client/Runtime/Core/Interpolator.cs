using System;

namespace ManipNet.Client
{
    /// <summary>
    /// Interpolates hands by capture time, a chosen delay behind, for any display rate; holds and then fades them on
    /// loss. Not thread-safe. Allocates nothing after construction.
    /// </summary>
    public sealed class Interpolator
    {
        const double HoldS = 0.5, FadeS = 0.5, BlendS = 0.2, StaleS = 0.25, StaleLimitS = 0.5;
        readonly Ring _ring = new Ring();
        readonly Mixer _mixer = new Mixer(Ring.Size);
        readonly SmoothClock _clock = new SmoothClock();
        readonly FixedName _session = new FixedName();
        readonly HandsFrame[] _pair = new HandsFrame[2];
        readonly double[] _pairWeights = new double[2];
        HandsFrame _shown = new HandsFrame();
        HandsFrame _held = new HandsFrame();
        bool _hasNewest, _hasShown, _starved, _blending;
        ulong _seq;
        double _capture, _t0, _now, _resumed, _weight;
        double _staleSince = double.NaN;

        public double DelayS = 0.1;

        /// <summary>The number of frames that came too late to be shown.</summary>
        public long Late { get; private set; }

        /// <summary>Adds a frame that arrived at the local time `arrival`, and returns a frame to fill next.</summary>
        public HandsFrame Push(HandsFrame frame, double arrival, out bool taken)
        {
            taken = Accept(frame, arrival);
            if (!taken)
            {
                Late++;
                return frame;
            }
            _clock.Observe(arrival, frame.TCapture);
            _session.CopyFrom(frame.Session);
            _seq = frame.Seq;
            _capture = frame.TCapture;
            _hasNewest = true;
            return _ring.Exchange(Grid(_capture), frame);
        }

        /// <summary>
        /// Computes the hands to show at the local time `now`, which must not decrease. Returns false before the first
        /// frame. `weight` falls from 1 to 0 when the stream is lost; use it to blend to another animation.
        /// </summary>
        public bool Sample(double now, HandsFrame output, out float weight)
        {
            weight = 0f;
            if (!_hasNewest) return false;
            double position = (_clock.CaptureTime(now) - DelayS - _t0) * Layout.RateHz;
            int nearest = _ring.Weigh(position);
            _mixer.Mix(_ring.Frames, _ring.Weights, nearest, output);
            double starved = (position - Grid(_capture)) / Layout.RateHz;
            Ease(output, starved, now);
            double target = 1.0 - Smoothstep((starved - HoldS) / FadeS);
            _weight = _hasShown ? Math.Min(target, _weight + (now - _now) / FadeS) : target;
            weight = (float)_weight;
            _shown.CopyFrom(output);
            _hasShown = true;
            _now = now;
            return true;
        }

        bool Accept(HandsFrame frame, double arrival)
        {
            bool same = _hasNewest && frame.Session.SameAs(_session);
            if (same && frame.Seq <= _seq) return false;
            if (!same || frame.TCapture < _capture - 0.5 / Layout.RateHz) Restart(frame);
            else if (IsStale(frame, arrival)) return false;
            else if (frame.TCapture - _capture >= (double)Ring.Size / Layout.RateHz) _ring.Clear();
            return true;
        }

        /// <summary>
        /// Starts again, for a new session or after the sender's clock went back, as when a take loops.
        /// </summary>
        void Restart(HandsFrame frame)
        {
            _ring.Clear();
            _clock.Reset();
            _t0 = frame.TCapture;
            _staleSince = double.NaN;
            _starved = _hasShown;
        }

        /// <summary>
        /// Whether the frame is backlog after a stall; if frames stay late for long, the clock has changed instead.
        /// </summary>
        bool IsStale(HandsFrame frame, double arrival)
        {
            if (arrival - frame.TCapture - _clock.Target <= StaleS)
            {
                _staleSince = double.NaN;
                return false;
            }
            if (double.IsNaN(_staleSince)) _staleSince = arrival;
            if (arrival - _staleSince <= StaleLimitS) return true;
            Restart(frame);
            return false;
        }

        /// <summary>Blends with the held pose for a short time after a gap.</summary>
        void Ease(HandsFrame output, double starved, double now)
        {
            if (starved > 1.0 / Layout.RateHz)
            {
                _starved = true;
            }
            else if (_starved)
            {
                _starved = false;
                _blending = _hasShown;
                _resumed = _now;
                HandsFrame free = _held;
                _held = _shown;
                _shown = free;
            }
            double part = (now - _resumed) / BlendS;
            _blending &= part < 1.0;
            if (!_blending) return;
            _shown.CopyFrom(output);
            _pair[0] = _held;
            _pair[1] = _shown;
            _pairWeights[1] = Smoothstep(part);
            _pairWeights[0] = 1.0 - _pairWeights[1];
            _mixer.Mix(_pair, _pairWeights, 1, output);
        }

        long Grid(double capture)
        {
            return (long)Math.Round((capture - _t0) * Layout.RateHz);
        }

        static double Smoothstep(double x)
        {
            x = Math.Min(Math.Max(x, 0.0), 1.0);
            return x * x * (3.0 - 2.0 * x);
        }
    }
}
