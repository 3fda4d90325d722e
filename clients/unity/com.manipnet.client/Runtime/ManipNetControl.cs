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

        [Tooltip("Name of the next recording.")]
        [SerializeField] string take = "take";

        [Tooltip("Tracked body that gets another object.")]
        [SerializeField] string body = "";

        [Tooltip("Object of the server's catalogue for the body.")]
        [SerializeField] string shape = "";

        [SerializeField] float shapeScale = 1f;

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

        /// <summary>The name of the next recording, for Record without one and for the buttons.</summary>
        public string Take
        {
            get { return take; }
            set { take = value; }
        }

        /// <summary>The tracked body that SelectObject without arguments gives an object.</summary>
        public string Body
        {
            get { return body; }
            set { body = value; }
        }

        /// <summary>The object of the server's catalogue that it gets.</summary>
        public string Shape
        {
            get { return shape; }
            set { shape = value; }
        }

        /// <summary>The object's scale.</summary>
        public float ShapeScale
        {
            get { return shapeScale; }
            set { shapeScale = value; }
        }

        public void Record()
        {
            Record(Take);
        }

        public void SelectObject()
        {
            SelectObject(Body, Shape, ShapeScale);
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
            ControlClient client;
            try
            {
                client = new ControlClient(address);
            }
            catch (ArgumentException error)
            {
                _lastReply = error.Message;
                return;
            }
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
