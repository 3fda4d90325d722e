using System.Diagnostics;

namespace ManipNet.Client
{
    /// <summary>A clock in seconds that never goes back.</summary>
    public static class LocalClock
    {
        static readonly double Period = 1.0 / Stopwatch.Frequency;

        public static double Now
        {
            get { return Stopwatch.GetTimestamp() * Period; }
        }
    }
}
