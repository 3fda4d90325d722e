using System;

namespace ManipNet.Client
{
    /// <summary>The state and the counters of a client.</summary>
    public struct Stats
    {
        public string State;

        /// <summary>Readable frames that arrived; Late are those of them that came too late to be shown.</summary>
        public long Received, Late;

        /// <summary>Frames that never arrived.</summary>
        public long Lost;

        /// <summary>Messages that could not be read.</summary>
        public long Refused;
        public int Connections;

        /// <summary>The server's number of the newest frame.</summary>
        public ulong Seq;
        public double RateHz;

        /// <summary>Seconds since the newest frame arrived.</summary>
        public double AgeS;

        /// <summary>
        /// Seconds from publication to arrival of the newest frame; meaningful only if server and client share a clock.
        /// </summary>
        public double TransitS;
    }

    /// <summary>Receives the hands of one actor, over ZeroMQ or a web socket.</summary>
    public interface IHandsClient : IDisposable
    {
        /// <summary>Seconds by which hands are shown late, to bridge jitter and lost frames.</summary>
        double DelayS { get; set; }

        /// <summary>Computes the hands to show at the time `now` of LocalClock; see Interpolator.Sample.</summary>
        bool Sample(double now, HandsFrame output, out float weight);
        Stats GetStats();
    }

    /// <summary>
    /// Decodes, counts and interpolates the messages of one actor. One thread may give it messages while another shows
    /// them.
    /// </summary>
    public sealed class HandsStream
    {
        readonly object _lock = new object();
        readonly Interpolator _interpolator = new Interpolator();
        readonly double[] _arrivals = new double[Layout.RateHz];
        readonly FixedName _session = new FixedName();
        readonly FixedName _actor = new FixedName();
        readonly string _onlyActor;
        HandsFrame _spare = new HandsFrame();
        Stats _stats;
        ulong _seq;
        double _newestAt = double.NegativeInfinity;

        /// <param name="actor">The actor whose hands are received; empty or null for the first one received.</param>
        /// <param name="delayS">Seconds by which hands are shown late, to bridge jitter and lost frames.</param>
        public HandsStream(string actor, double delayS)
        {
            _onlyActor = actor;
            _interpolator.DelayS = delayS;
            _stats.State = "connecting";
        }

        public double DelayS
        {
            get { lock (_lock) return _interpolator.DelayS; }
            set { lock (_lock) _interpolator.DelayS = value; }
        }

        /// <summary>The number of frames that were received.</summary>
        public long Received
        {
            get { lock (_lock) return _stats.Received; }
        }

        public bool Sample(double now, HandsFrame output, out float weight)
        {
            lock (_lock) return _interpolator.Sample(now, output, out weight);
        }

        public void SetState(string state)
        {
            lock (_lock) _stats.State = state;
        }

        /// <summary>Notes that a connection was made.</summary>
        public void Connected()
        {
            lock (_lock)
            {
                _stats.Connections++;
                _stats.State = "connected";
            }
        }

        public Stats GetStats()
        {
            lock (_lock)
            {
                Stats stats = _stats;
                double now = LocalClock.Now;
                stats.Late = _interpolator.Late;
                stats.AgeS = now - _newestAt;
                stats.Seq = _seq;
                int recent = 0;
                double earliest = now, latest = 0.0;
                for (int i = 0; i < Math.Min(_stats.Received, _arrivals.Length); i++)
                {
                    if (now - _arrivals[i] > 1.0) continue;
                    recent++;
                    earliest = Math.Min(earliest, _arrivals[i]);
                    latest = Math.Max(latest, _arrivals[i]);
                }
                stats.RateHz = recent > 1 ? (recent - 1) / (latest - earliest) : 0.0;
                return stats;
            }
        }

        /// <summary>Takes the payload of a message, which arrived at the time `arrival` of LocalClock.</summary>
        public void Take(byte[] data, int start, int length, double arrival)
        {
            string error = HandsDecoder.Decode(data, start, length, _spare);
            lock (_lock)
            {
                if (error != null) Refuse(error);
                else if (IsOurActor()) Push(arrival);
            }
        }

        /// <summary>Counts a message that cannot be read, and shows why.</summary>
        public void Refuse(string reason)
        {
            lock (_lock)
            {
                _stats.Refused++;
                _stats.State = "message refused: " + reason;
            }
        }

        void Push(double arrival)
        {
            bool same = _stats.Received > 0 && _spare.Session.SameAs(_session);
            if (same && _spare.Seq > _seq + 1) _stats.Lost += (long)(_spare.Seq - _seq - 1);
            _session.CopyFrom(_spare.Session);
            _seq = _spare.Seq;
            _arrivals[_stats.Received++ % _arrivals.Length] = arrival;
            _stats.TransitS = arrival - _spare.TPublish;
            bool taken;
            _spare = _interpolator.Push(_spare, arrival, out taken);
            if (taken) _newestAt = arrival;
            _stats.State = "connected";
        }

        bool IsOurActor()
        {
            if (!string.IsNullOrEmpty(_onlyActor)) return _spare.Actor.Text == _onlyActor;
            if (_stats.Received == 0) _actor.CopyFrom(_spare.Actor);
            return _spare.Actor.SameAs(_actor);
        }
    }
}
