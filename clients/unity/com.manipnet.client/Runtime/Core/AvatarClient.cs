using System;
using System.IO;
using System.Net.Sockets;
using System.Threading;

namespace ManipNet.Client
{
    /// <summary>
    /// Receives the hands that the server solves on an avatar. It uploads the hand profile on a thread of its own: at first,
    /// whenever it has connected again, and while no hands arrive, because the server forgets a profile when it restarts
    /// or when nobody has been subscribed for 60 s.
    /// </summary>
    public sealed class AvatarClient : IHandsClient
    {
        const int StepMs = 100;
        const double SilentS = 2.0, RetryS = 5.0;
        readonly ManipNetClient _hands;
        readonly ControlClient _control;
        readonly string _request;
        readonly ManualResetEvent _stop = new ManualResetEvent(false);
        readonly Thread _thread;
        volatile string _problem;
        int _uploaded;
        double _tried = double.NegativeInfinity;

        /// <param name="address">The address `hands` in the server's line `ready`.</param>
        /// <param name="control">The address `control` there.</param>
        /// <param name="name">The name in the profile.</param>
        /// <param name="profile">The hand profile in JSON.</param>
        /// <param name="actor">The actor who drives the avatar; empty or null for the server's first.</param>
        /// <param name="delayS">Seconds by which hands are shown late, to bridge jitter and lost frames.</param>
        public AvatarClient(string address, string control, string name, string profile, string actor = null, double delayS = 0.1)
        {
            string who = string.IsNullOrEmpty(actor) ? "" : ", \"actor\": " + ControlClient.Quoted(actor);
            _request = "{\"op\": \"hand_profile\", \"profile\": " + profile + who + "}";
            _control = new ControlClient(control, 3.0);
            _hands = new ManipNetClient(address, actor, delayS, "hand/" + name + "/bin ");
            _thread = new Thread(Run) { IsBackground = true, Name = "ManipNet hand profile" };
            _thread.Start();
        }

        public void Dispose()
        {
            _stop.Set();
            _hands.Dispose();
            _thread.Join();
        }

        public double DelayS
        {
            get { return _hands.DelayS; }
            set { _hands.DelayS = value; }
        }

        public bool Sample(double now, HandsFrame output, out float weight)
        {
            return _hands.Sample(now, output, out weight);
        }

        /// <summary>The counters of the stream; its state tells why the profile could not be uploaded, if so.</summary>
        public Stats GetStats()
        {
            Stats stats = _hands.GetStats();
            string problem = _problem;
            if (problem != null) stats.State = problem;
            return stats;
        }

        void Run()
        {
            while (!_stop.WaitOne(StepMs))
            {
                Stats stats = _hands.GetStats();
                bool connectedAgain = stats.Connections > _uploaded;
                bool due = LocalClock.Now - _tried > RetryS && stats.Connections > 0 && stats.AgeS > SilentS;
                if (connectedAgain && (_problem == null || due) || due) Upload(stats.Connections);
            }
        }

        void Upload(int connections)
        {
            _tried = LocalClock.Now;
            try
            {
                _control.AskJson(_request);
                _uploaded = connections;
                _problem = null;
            }
            catch (RequestException error)
            {
                _problem = "the server refused the hand profile: " + error.Message;
            }
            catch (Exception error) when (error is IOException || error is SocketException)
            {
                _problem = "the hand profile could not be uploaded: " + error.Message;
            }
        }
    }
}
