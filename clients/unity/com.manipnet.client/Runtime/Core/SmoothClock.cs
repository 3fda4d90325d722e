using System;

namespace ManipNet.Client
{
    /// <summary>
    /// Estimates the sender's clock. The offset is a critically damped spring towards the smallest difference of
    /// arrival and capture time in about the last second, so neither jitter nor a better estimate makes a step.
    /// </summary>
    public sealed class SmoothClock
    {
        const int Window = 64;
        const double StiffnessHz = 2.0;
        const double SnapS = 0.25;
        readonly double[] _offsets = new double[Window];
        int _count;
        double _offset, _speed, _now;

        public double Target
        {
            get
            {
                double least = double.PositiveInfinity;
                for (int i = 0; i < Math.Min(_count, Window); i++) least = Math.Min(least, _offsets[i]);
                return least;
            }
        }

        public void Reset()
        {
            _count = 0;
        }

        public void Observe(double arrival, double capture)
        {
            _offsets[_count % Window] = arrival - capture;
            if (_count == 0)
            {
                _offset = arrival - capture;
                _speed = 0.0;
                _now = arrival;
            }
            _count = _count + 1 < 2 * Window ? _count + 1 : Window;
        }

        /// <summary>The sender's time at the local time `now`, which must not decrease between calls.</summary>
        public double CaptureTime(double now)
        {
            double step = Math.Max(now - _now, 0.0);
            _now = Math.Max(now, _now);
            double target = Target;
            double error = _offset - target;
            if (Math.Abs(error) > SnapS)
            {
                _offset = target;
                _speed = 0.0;
                return now - _offset;
            }
            double pull = _speed + StiffnessHz * error;
            double decay = Math.Exp(-StiffnessHz * step);
            _offset = target + (error + pull * step) * decay;
            _speed = (_speed - StiffnessHz * pull * step) * decay;
            return now - _offset;
        }
    }
}
