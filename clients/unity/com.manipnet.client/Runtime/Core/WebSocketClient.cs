using System;

namespace ManipNet.Client
{
    public enum WebSocketState { Connecting, Open, Closed }

    /// <summary>A web socket that keeps its messages until they are taken. No method waits.</summary>
    public interface IWebSocket
    {
        void Open(string address);
        WebSocketState State { get; }

        /// <summary>The size in bytes of the oldest message, 0 if there is none.</summary>
        int NextLength { get; }

        /// <summary>Copies the oldest message and removes it.</summary>
        void Take(byte[] into);

        /// <summary>Removes the oldest message.</summary>
        void Skip();
        void Close();
    }

    /// <summary>
    /// Receives the hands of one actor over a web socket, for browsers, where neither threads nor TCP exist. It works
    /// whenever Sample is called, and reconnects by itself.
    /// </summary>
    public sealed class WebSocketClient : IHandsClient
    {
        const double BackOffS = 0.1, BackOffLimitS = 1.0, DeadAfterS = 5.0;
        readonly IWebSocket _socket;
        readonly string _address;
        readonly HandsStream _stream;
        readonly byte[] _buffer = new byte[Layout.MaxPayloadBytes];
        WebSocketState _state;
        double _wait = BackOffS, _retryAt, _heard;

        /// <param name="socket">The browser's web socket, or another one in tests.</param>
        /// <param name="address">ws://HOST:PORT or wss://HOST:PORT</param>
        /// <param name="actor">The actor whose hands are received; empty or null for the first one received.</param>
        /// <param name="delayS">Seconds by which hands are shown late, to bridge jitter and lost frames.</param>
        public WebSocketClient(IWebSocket socket, string address, string actor = null, double delayS = 0.1)
        {
            bool good = address != null && (address.StartsWith("ws://", StringComparison.Ordinal) && address.Length > 5
                || address.StartsWith("wss://", StringComparison.Ordinal) && address.Length > 6);
            if (!good) throw new ArgumentException("the web address is \"" + address + "\"; a browser allows ws://HOST:PORT, as in ws://127.0.0.1:8081");
            _socket = socket;
            _address = address;
            _stream = new HandsStream(actor, delayS);
            Open(LocalClock.Now);
        }

        public void Dispose()
        {
            _socket.Close();
            _stream.SetState("closed");
        }

        public double DelayS
        {
            get { return _stream.DelayS; }
            set { _stream.DelayS = value; }
        }

        public Stats GetStats()
        {
            return _stream.GetStats();
        }

        public bool Sample(double now, HandsFrame output, out float weight)
        {
            Poll(now);
            return _stream.Sample(now, output, out weight);
        }

        void Open(double now)
        {
            _state = WebSocketState.Connecting;
            _heard = now;
            _socket.Open(_address);
        }

        void Poll(double now)
        {
            if (_state == WebSocketState.Closed)
            {
                if (now >= _retryAt) Open(now);
                return;
            }
            WebSocketState state = _socket.State;
            if (state == WebSocketState.Open && _state == WebSocketState.Connecting) _stream.Connected();
            if (state == WebSocketState.Open) _state = state;
            while (_socket.NextLength > 0) TakeOne(now);
            // The socket of a vanished server stays open, or opening, for minutes.
            if (state == WebSocketState.Closed || now - _heard > DeadAfterS) Retry(now);
        }

        void TakeOne(double now)
        {
            int length = _socket.NextLength;
            _heard = now;
            if (length > _buffer.Length)
            {
                _socket.Skip();
                _stream.Refuse("the message has " + length + " bytes; at most " + _buffer.Length + " are allowed");
                return;
            }
            _socket.Take(_buffer);
            _stream.Take(_buffer, 0, length, now);
            _wait = BackOffS;
        }

        void Retry(double now)
        {
            _socket.Close();
            _state = WebSocketState.Closed;
            _stream.SetState("reconnecting: no server answers at " + _address);
            _retryAt = now + _wait;
            _wait = Math.Min(2.0 * _wait, BackOffLimitS);
        }
    }
}
