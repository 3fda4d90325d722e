using System;
using System.IO;
using System.Net;
using System.Net.Sockets;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>
    /// A ZeroMQ subscriber to one topic on a plain TCP socket: ZMTP 3 with the NULL mechanism. It allocates nothing
    /// after the handshake. One thread uses it, but any may set Stop, which ends every wait within a twentieth of a
    /// second.
    /// </summary>
    public sealed class ZmtpSubscriber
    {
        const int More = 1, Long = 2, Command = 4;
        const int SignatureBytes = 11;
        const int ConnectMs = 2000, WaitMs = 250, SliceMs = 50;
        const double PingAfterS = 1.0, DeadAfterS = 3.0;
        static readonly byte[] Ping = { Command, 7, 4, (byte)'P', (byte)'I', (byte)'N', (byte)'G', 0, 0 };
        readonly byte[] _reply = new byte[32];
        readonly int _maxBytes;
        Socket _socket;
        int _start, _end, _resume;
        int _flags;
        bool _insideMessage;
        double _heard, _pinged;

        public ZmtpSubscriber(int maxBytes)
        {
            _maxBytes = maxBytes;
            Buffer = new byte[2 * (maxBytes + 16)];
        }

        public volatile bool Stop;

        /// <summary>Holds the message that NextMessage found, until the next call.</summary>
        public byte[] Buffer { get; private set; }
        public int MessageStart { get; private set; }
        public int MessageLength { get; private set; }

        /// <summary>Connects and subscribes; throws IOException or SocketException with the reason.</summary>
        public void Open(string host, int port, byte[] topic)
        {
            _start = _end = _resume = 0;
            _insideMessage = false;
            _heard = _pinged = LocalClock.Now;
            _socket = Connect(host, port);
            _socket.NoDelay = true;
            _socket.ReceiveTimeout = _socket.SendTimeout = ConnectMs;
            Handshake(topic);
        }

        Socket Connect(string host, int port)
        {
            IPAddress address;
            IPAddress[] addresses = IPAddress.TryParse(host, out address) ? new[] { address } : Dns.GetHostAddresses(host);
            return ConnectToAny(addresses, host, port);
        }

        /// <summary>
        /// Connects to the first address that answers. A name may have several: `localhost` is ::1 before 127.0.0.1 on
        /// Windows, and a server listens on one of them.
        /// </summary>
        public Socket ConnectToAny(IPAddress[] addresses, string host, int port)
        {
            foreach (IPAddress address in addresses)
            {
                Socket socket = TryConnect(address, port);
                if (socket != null) return socket;
            }
            throw new IOException("no server answers at " + host + ":" + port);
        }

        /// <summary>Connects without the thread pool, whose threads would remain. Returns null if nobody answers.</summary>
        Socket TryConnect(IPAddress address, int port)
        {
            Socket socket = null;
            try
            {
                socket = new Socket(address.AddressFamily, SocketType.Stream, ProtocolType.Tcp) { Blocking = false };
                socket.Connect(new IPEndPoint(address, port));
            }
            catch (SocketException error) when (error.SocketErrorCode == SocketError.WouldBlock || error.SocketErrorCode == SocketError.InProgress)
            {
                // the connection is being made
            }
            catch (SocketException)
            {
                if (socket != null) socket.Close(); // the machine has no such network, as without IPv6
                return null;
            }
            bool open = Ready(socket, ConnectMs, SelectMode.SelectWrite);
            if (open && (int)socket.GetSocketOption(SocketOptionLevel.Socket, SocketOptionName.Error) == 0)
            {
                socket.Blocking = true;
                return socket;
            }
            socket.Close();
            return null;
        }

        public void Close()
        {
            if (_socket != null) _socket.Close();
            _socket = null;
        }

        /// <summary>
        /// Finds the next complete message and waits at most a quarter of a second for it. Returns false if none has
        /// arrived. Throws when the connection is lost or when the other side does not even answer a ping.
        /// </summary>
        public bool NextMessage()
        {
            while (NextFrame())
            {
                int flags = _flags;
                if ((flags & Command) != 0)
                {
                    Answer();
                    continue;
                }
                bool complete = (flags & More) == 0 && !_insideMessage; // all of ours have one frame; longer messages are skipped
                _insideMessage = (flags & More) != 0;
                if (complete) return true;
            }
            Receive(WaitMs);
            return false;
        }

        bool NextFrame()
        {
            _start = _resume;
            int available = _end - _start;
            if (available < 2) return false;
            _flags = Buffer[_start];
            int head = (_flags & Long) != 0 ? 9 : 2;
            if (available < head) return false;
            long size = 0;
            for (int i = 1; i < head; i++) size = size << 8 | Buffer[_start + i];
            if (size < 0 || size > _maxBytes) throw new IOException("the server sent a frame of " + size + " bytes; at most " + _maxBytes + " are allowed");
            if (available < head + size) return false;
            MessageStart = _start + head;
            MessageLength = (int)size;
            _resume = MessageStart + MessageLength;
            return true;
        }

        void Receive(int waitMs)
        {
            if (_start > 0)
            {
                Array.Copy(Buffer, _start, Buffer, 0, _end - _start);
                _end -= _start;
                _start = _resume = 0;
            }
            if (!Ready(_socket, waitMs, SelectMode.SelectRead))
            {
                CheckAlive();
                return;
            }
            int count = _socket.Receive(Buffer, _end, Buffer.Length - _end, SocketFlags.None);
            if (count == 0) throw new IOException("the server closed the connection");
            _end += count;
            _heard = LocalClock.Now;
        }

        /// <summary>Waits by the clock, because a slice takes longer on a busy machine.</summary>
        bool Ready(Socket socket, int waitMs, SelectMode mode)
        {
            double until = LocalClock.Now + 0.001 * waitMs;
            while (!Stop)
            {
                if (socket.Poll(1000 * SliceMs, mode)) return true;
                if (mode == SelectMode.SelectWrite && socket.Poll(0, SelectMode.SelectError)) return false; // refused, on Windows
                if (LocalClock.Now >= until) return false;
            }
            return false;
        }

        void CheckAlive()
        {
            double now = LocalClock.Now;
            if (now - _heard > DeadAfterS) throw new IOException("nothing has arrived for " + DeadAfterS + " s");
            if (now - _heard < PingAfterS || now - _pinged < PingAfterS) return;
            _pinged = now;
            _socket.Send(Ping, 0, Ping.Length, SocketFlags.None);
        }

        void Answer()
        {
            const string ping = "\x04PING";
            if (!StartsWith(ping)) return;
            int context = Math.Max(0, Math.Min(MessageLength - 7, 16));
            _reply[0] = Command;
            _reply[1] = (byte)(5 + context);
            Encoding.ASCII.GetBytes("\x04PONG", 0, 5, _reply, 2);
            Array.Copy(Buffer, MessageStart + 7, _reply, 7, context);
            _socket.Send(_reply, 0, 7 + context, SocketFlags.None);
        }

        void Handshake(byte[] topic)
        {
            var greeting = new byte[64];
            greeting[0] = 0xFF;
            greeting[9] = 0x7F;
            greeting[10] = 3;
            greeting[11] = 1;
            Encoding.ASCII.GetBytes("NULL", 0, 4, greeting, 12);
            // Some servers that dislike the rest of the greeting close the connection without a reason, so it is sent later.
            _socket.Send(greeting, 0, SignatureBytes, SocketFlags.None);
            while (_end < 64) ReceiveGreeting();
            if (Buffer[0] != 0xFF || (Buffer[9] & 1) == 0 || Buffer[10] < 3) throw new IOException("the other side does not speak ZMTP 3");
            string mechanism = Encoding.ASCII.GetString(Buffer, 12, 20).TrimEnd('\0');
            if (mechanism != "NULL")
                throw new IOException("the server requires " + mechanism + ", which this client does not support; use a tunnel");
            bool byCommand = Buffer[11] >= 1;
            _resume = 64;
            _socket.Send(greeting, SignatureBytes, 64 - SignatureBytes, SocketFlags.None);
            Send(Command, Encoding.ASCII.GetBytes("\x05READY\x0bSocket-Type\0\0\0\x03SUB"));
            while (!NextFrame()) ReceiveGreeting();
            if ((_flags & Command) == 0 || !StartsWith("\x05READY")) throw new IOException("the server refused the connection");
            byte[] prefix = Encoding.ASCII.GetBytes(byCommand ? "\x09SUBSCRIBE" : "\x01");
            var subscribe = new byte[prefix.Length + topic.Length];
            prefix.CopyTo(subscribe, 0);
            topic.CopyTo(subscribe, prefix.Length);
            Send(byCommand ? Command : 0, subscribe);
        }

        void ReceiveGreeting()
        {
            int before = _end;
            Receive(ConnectMs);
            if (_end == before) throw new IOException("the other side does not speak ZMTP 3: it sends nothing");
        }

        void Send(int flags, byte[] body)
        {
            var frame = new byte[2 + body.Length];
            frame[0] = (byte)flags;
            frame[1] = (byte)body.Length;
            body.CopyTo(frame, 2);
            _socket.Send(frame);
        }

        bool StartsWith(string ascii)
        {
            if (MessageLength < ascii.Length) return false;
            for (int i = 0; i < ascii.Length; i++)
                if (Buffer[MessageStart + i] != ascii[i]) return false;
            return true;
        }
    }
}
