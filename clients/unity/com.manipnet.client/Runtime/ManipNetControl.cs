using System;
using System.IO;
using System.Net.Sockets;
using System.Threading;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Controls the server from a scene: recording, pause, objects, look-ahead. Requests are sent one after the other on
    /// a thread, so no method waits; LastReply tells the result. A browser cannot send them.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Control")]
    public sealed class ManipNetControl : MonoBehaviour
    {
        [Tooltip("Address `control` in the server's line `ready`.")]
        [SerializeField] string address = "tcp://127.0.0.1:5557";

        readonly object _order = new object();
        volatile string _lastReply = "";
        int _open;

        public string Address
        {
            get { return address; }
            set { address = value; }
        }

        /// <summary>The reply to the newest request, in JSON, or what went wrong.</summary>
        public string LastReply
        {
            get { return _lastReply; }
        }

        /// <summary>Whether a request waits for its reply.</summary>
        public bool IsBusy
        {
            get { return Volatile.Read(ref _open) > 0; }
        }

        /// <summary>Starts a recording on the server.</summary>
        public void Record(string take)
        {
            Send("record", "name", take);
        }

        public void StopRecording()
        {
            Send("stop_recording");
        }

        public void Pause(bool on)
        {
            Send("pause", "on", on);
        }

        /// <summary>Gives a tracked body another object of the server's catalogue.</summary>
        public void SelectObject(string body, string shape, float scale)
        {
            Send("select_object", "body", body, "object", shape, "scale", scale);
        }

        public void LookAhead(float seconds)
        {
            Send("look_ahead", "seconds", seconds);
        }

        /// <summary>Sends any request of docs/protocol.md, with its fields as names and values in turn.</summary>
        public void Send(string op, params object[] fields)
        {
#if UNITY_WEBGL && !UNITY_EDITOR
            _lastReply = "a browser cannot send requests to the control port";
#else
            var client = new ControlClient(address);
            Interlocked.Increment(ref _open);
            ThreadPool.QueueUserWorkItem(_ => Answer(client, op, fields));
#endif
        }

        void Answer(ControlClient client, string op, object[] fields)
        {
            lock (_order)
            {
                try
                {
                    _lastReply = client.Ask(op, fields);
                }
                catch (Exception error) when (error is RequestException || error is IOException || error is SocketException)
                {
                    _lastReply = error.Message;
                }
            }
            Interlocked.Decrement(ref _open);
        }
    }
}
