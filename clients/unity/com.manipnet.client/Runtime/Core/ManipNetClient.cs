using System;
using System.IO;
using System.Net.Sockets;
using System.Threading;

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

    /// <summary>
    /// Receives the hands of one actor on its own thread and reconnects by itself. Any thread may call the methods, and
    /// no method waits for the network except Dispose, which waits for the thread.
    /// </summary>
    public sealed class ManipNetClient : IDisposable
    {
        const int BackOffMs = 100, BackOffLimitMs = 1000;
        readonly string _host;
        readonly int _port;
        readonly object _lock = new object();
        readonly ManualResetEvent _stop = new ManualResetEvent(false);
        readonly ZmtpSubscriber _subscriber;
        readonly Interpolator _interpolator = new Interpolator();
        readonly double[] _arrivals = new double[Layout.RateHz];
        readonly FixedName _session = new FixedName();
        readonly FixedName _actor = new FixedName();
        readonly Thread _thread;
        readonly string _onlyActor;
        HandsFrame _spare = new HandsFrame();
        Stats _stats;
        ulong _seq;
        double _newestAt = double.NegativeInfinity;

        /// <param name="address">tcp://HOST:PORT</param>
        /// <param name="actor">The actor whose hands are received; empty or null for the first one received.</param>
        /// <param name="delayS">Seconds by which hands are shown late, to bridge jitter and lost frames.</param>
        public ManipNetClient(string address, string actor = null, double delayS = 0.1)
        {
            ParseAddress(address, out _host, out _port);
            _onlyActor = actor;
            _interpolator.DelayS = delayS;
            _stats.State = "connecting";
            _subscriber = new ZmtpSubscriber(Layout.MaxPayloadBytes);
            _thread = new Thread(Run) { IsBackground = true, Name = "ManipNet client" };
            _thread.Start();
        }

        public void Dispose()
        {
            _subscriber.Stop = true;
            _stop.Set();
            _thread.Join();
        }

        public double DelayS
        {
            get { lock (_lock) return _interpolator.DelayS; }
            set { lock (_lock) _interpolator.DelayS = value; }
        }

        /// <summary>Computes the hands to show at the time `now` of LocalClock; see Interpolator.Sample.</summary>
        public bool Sample(double now, HandsFrame output, out float weight)
        {
            lock (_lock) return _interpolator.Sample(now, output, out weight);
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

        /// <summary>Splits an address; throws ArgumentException that says what is allowed.</summary>
        public static void ParseAddress(string address, out string host, out int port)
        {
            const string scheme = "tcp://";
            int colon = address == null ? -1 : address.LastIndexOf(':');
            port = 0;
            bool good = address != null && address.StartsWith(scheme, StringComparison.Ordinal) && colon > scheme.Length
                && int.TryParse(address.Substring(colon + 1), out port) && port > 0 && port < 65536;
            if (!good) throw new ArgumentException("the address is \"" + address + "\"; allowed is tcp://HOST:PORT, as in tcp://127.0.0.1:5555");
            host = address.Substring(scheme.Length, colon - scheme.Length).Trim('[', ']');
        }

        void Run()
        {
            int wait = BackOffMs;
            while (!_subscriber.Stop)
            {
                long before = _stats.Received;
                try
                {
                    Read();
                }
                catch (Exception error) when (error is IOException || error is SocketException)
                {
                    SetState("reconnecting: " + error.Message);
                }
                finally
                {
                    _subscriber.Close();
                }
                wait = _stats.Received > before ? BackOffMs : Math.Min(2 * wait, BackOffLimitMs);
                _stop.WaitOne(wait);
            }
            SetState("closed");
        }

        void Read()
        {
            _subscriber.Open(_host, _port, Layout.Topic);
            lock (_lock) _stats.Connections++;
            SetState("connected");
            while (!_subscriber.Stop)
                if (_subscriber.NextMessage())
                    Take(LocalClock.Now);
        }

        void Take(double arrival)
        {
            if (!HasTopic()) return;
            int topic = Layout.Topic.Length;
            string error = HandsDecoder.Decode(_subscriber.Buffer, _subscriber.MessageStart + topic, _subscriber.MessageLength - topic, _spare);
            if (error != null)
            {
                lock (_lock) _stats.Refused++;
                SetState("message refused: " + error);
                return;
            }
            lock (_lock)
            {
                if (!IsOurActor()) return;
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
        }

        bool HasTopic()
        {
            string topic = Layout.Topic;
            if (_subscriber.MessageLength < topic.Length) return false;
            for (int i = 0; i < topic.Length; i++)
                if (_subscriber.Buffer[_subscriber.MessageStart + i] != topic[i]) return false;
            return true;
        }

        bool IsOurActor()
        {
            if (!string.IsNullOrEmpty(_onlyActor)) return _spare.Actor.Text == _onlyActor;
            if (_stats.Received == 0) _actor.CopyFrom(_spare.Actor);
            return _spare.Actor.SameAs(_actor);
        }

        void SetState(string state)
        {
            lock (_lock) _stats.State = state;
        }
    }
}
