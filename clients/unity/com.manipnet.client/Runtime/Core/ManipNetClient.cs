using System;
using System.IO;
using System.Net.Sockets;
using System.Text;
using System.Threading;

namespace ManipNet.Client
{
    /// <summary>
    /// Receives the hands of one actor over ZeroMQ on its own thread and reconnects by itself. Any thread may call the
    /// methods, and no method waits for the network except Dispose, which waits for the thread.
    /// </summary>
    public sealed class ManipNetClient : IHandsClient
    {
        const int BackOffMs = 100, BackOffLimitMs = 1000;
        readonly string _host;
        readonly int _port;
        readonly byte[] _topic;
        readonly ManualResetEvent _stop = new ManualResetEvent(false);
        readonly ZmtpSubscriber _subscriber;
        readonly HandsStream _stream;
        readonly Thread _thread;

        /// <param name="address">tcp://HOST:PORT</param>
        /// <param name="actor">The actor whose hands are received; empty or null for the first one received.</param>
        /// <param name="delayS">Seconds by which hands are shown late, to bridge jitter and lost frames.</param>
        /// <param name="topic">What is subscribed to, with the space at its end.</param>
        public ManipNetClient(string address, string actor = null, double delayS = 0.1, string topic = Layout.Topic)
        {
            _topic = Encoding.UTF8.GetBytes(topic);
            ParseAddress(address, out _host, out _port);
            _stream = new HandsStream(actor, delayS);
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
            get { return _stream.DelayS; }
            set { _stream.DelayS = value; }
        }

        public bool Sample(double now, HandsFrame output, out float weight)
        {
            return _stream.Sample(now, output, out weight);
        }

        public Stats GetStats()
        {
            return _stream.GetStats();
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
                long before = _stream.Received;
                try
                {
                    Read();
                }
                catch (Exception error) when (error is IOException || error is SocketException)
                {
                    _stream.SetState("reconnecting: " + error.Message);
                }
                finally
                {
                    _subscriber.Close();
                }
                wait = _stream.Received > before ? BackOffMs : Math.Min(2 * wait, BackOffLimitMs);
                _stop.WaitOne(wait);
            }
            _stream.SetState("closed");
        }

        void Read()
        {
            _subscriber.Open(_host, _port, _topic);
            _stream.Connected();
            int topic = _topic.Length;
            while (!_subscriber.Stop)
                if (_subscriber.NextMessage() && HasTopic())
                    _stream.Take(_subscriber.Buffer, _subscriber.MessageStart + topic, _subscriber.MessageLength - topic, LocalClock.Now);
        }

        bool HasTopic()
        {
            if (_subscriber.MessageLength < _topic.Length) return false;
            for (int i = 0; i < _topic.Length; i++)
                if (_subscriber.Buffer[_subscriber.MessageStart + i] != _topic[i]) return false;
            return true;
        }
    }
}
