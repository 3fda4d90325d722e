using System;
using System.Globalization;
using System.IO;
using System.Net;
using System.Net.Sockets;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>The server refused a request; the message is the server's own.</summary>
    public sealed class RequestException : Exception
    {
        /// <param name="reply">The reply in JSON: {"error": "why"}.</param>
        public RequestException(string reply) : base(Reason(reply)) { }

        static string Reason(string reply)
        {
            var reader = new JsonReader(reply);
            bool error = reader.Take('{') && reader.TakeText() == "error" && reader.Take(':');
            return (error ? reader.TakeText() : null) ?? reply;
        }
    }

    /// <summary>
    /// Sends requests to the server's control port, one connection for each: record, pause, select an object and the rest
    /// of docs/protocol.md. It waits for the reply, so call it on a thread of its own.
    /// </summary>
    public sealed class ControlClient
    {
        const int More = 1, Long = 2, Command = 4, GreetingBytes = 64, MaxReplyBytes = 1 << 26;
        readonly string _host;
        readonly int _port;
        readonly int _timeoutMs;

        /// <param name="address">tcp://HOST:PORT, the address `control` in the server's line `ready`</param>
        /// <param name="timeoutS">Seconds after which a request without a reply fails.</param>
        public ControlClient(string address = "tcp://127.0.0.1:5557", double timeoutS = 10.0)
        {
            ManipNetClient.ParseAddress(address, out _host, out _port);
            _timeoutMs = (int)(1000.0 * timeoutS);
        }

        /// <summary>
        /// Sends a request with its fields, given as names and values in turn (text, numbers, true and false), and returns
        /// the reply in JSON. Throws RequestException if the server refuses, and IOException or SocketException if it
        /// cannot be reached or does not answer in time.
        /// </summary>
        public string Ask(string op, params object[] fields)
        {
            return AskJson(Request(op, fields));
        }

        /// <summary>As Ask, with the whole request in JSON.</summary>
        public string AskJson(string request)
        {
            byte[] body = Encoding.UTF8.GetBytes(request);
            IPAddress address;
            IPAddress[] addresses = IPAddress.TryParse(_host, out address) ? new[] { address } : Dns.GetHostAddresses(_host);
            using (Socket socket = new ZmtpSubscriber(1).ConnectToAny(addresses, _host, _port))
            {
                socket.NoDelay = true;
                socket.ReceiveTimeout = socket.SendTimeout = _timeoutMs;
                using (var stream = new NetworkStream(socket)) return Check(Exchange(stream, body));
            }
        }

        /// <summary>The request in JSON.</summary>
        public static string Request(string op, params object[] fields)
        {
            if (fields.Length % 2 != 0) throw new ArgumentException("the fields of a request are names and values in turn");
            var text = new StringBuilder("{\"op\": " + Value(op));
            for (int i = 0; i < fields.Length; i += 2) text.Append(", " + Value((string)fields[i]) + ": " + Value(fields[i + 1]));
            return text.Append("}").ToString();
        }

        static string Value(object value)
        {
            if (value == null) return "null";
            if (value is bool) return (bool)value ? "true" : "false";
            if (value is string) return Quoted((string)value);
            return Convert.ToDouble(value, CultureInfo.InvariantCulture).ToString("R", CultureInfo.InvariantCulture);
        }

        /// <summary>A text in JSON, with its quotes.</summary>
        public static string Quoted(string text)
        {
            var quoted = new StringBuilder("\"");
            foreach (char c in text)
            {
                if (c == '"' || c == '\\') quoted.Append('\\').Append(c);
                else if (c < ' ') quoted.Append("\\u").Append(((int)c).ToString("x4"));
                else quoted.Append(c);
            }
            return quoted.Append('"').ToString();
        }

        static string Check(string reply)
        {
            if (reply.StartsWith("{\"error\"", StringComparison.Ordinal)) throw new RequestException(reply);
            return reply;
        }

        static string Exchange(Stream stream, byte[] body)
        {
            var greeting = new byte[GreetingBytes];
            greeting[0] = 0xFF;
            greeting[9] = 0x7F;
            greeting[10] = 3;
            Encoding.ASCII.GetBytes("NULL", 0, 4, greeting, 12);
            stream.Write(greeting, 0, GreetingBytes);
            byte[] theirs = Read(stream, GreetingBytes);
            string mechanism = Encoding.ASCII.GetString(theirs, 12, 20).TrimEnd('\0');
            if (theirs[0] != 0xFF || theirs[10] < 3) throw new IOException("the other side does not speak ZMTP 3");
            if (mechanism != "NULL") throw new IOException("the server requires " + mechanism + ", which this client does not support; use a tunnel");
            Write(stream, Command, Encoding.ASCII.GetBytes("\x05READY\x0bSocket-Type\0\0\0\x03REQ"));
            int flags;
            ReadFrame(stream, out flags);
            Write(stream, More, new byte[0]); // a request begins with an empty frame, and so does its reply
            Write(stream, 0, body);
            while (true)
            {
                byte[] frame = ReadFrame(stream, out flags);
                if ((flags & (Command | More)) == 0) return Encoding.UTF8.GetString(frame);
            }
        }

        static void Write(Stream stream, int flags, byte[] body)
        {
            bool wide = body.Length > 255;
            var head = new byte[wide ? 9 : 2];
            head[0] = (byte)(flags | (wide ? Long : 0));
            for (int i = 1; i < head.Length; i++) head[i] = (byte)((long)body.Length >> 8 * (head.Length - 1 - i));
            stream.Write(head, 0, head.Length);
            stream.Write(body, 0, body.Length);
        }

        static byte[] ReadFrame(Stream stream, out int flags)
        {
            flags = Read(stream, 1)[0];
            long size = 0;
            foreach (byte part in Read(stream, (flags & Long) != 0 ? 8 : 1)) size = size << 8 | part;
            if (size < 0 || size > MaxReplyBytes) throw new IOException("the server sent a frame of " + size + " bytes; at most " + MaxReplyBytes + " are allowed");
            return Read(stream, (int)size);
        }

        static byte[] Read(Stream stream, int count)
        {
            var data = new byte[count];
            for (int done = 0; done < count;)
            {
                int got = stream.Read(data, done, count - done);
                if (got == 0) throw new IOException("the server closed the connection");
                done += got;
            }
            return data;
        }
    }
}
