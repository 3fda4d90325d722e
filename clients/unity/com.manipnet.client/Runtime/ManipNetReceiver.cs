using System;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Receives hands while it is enabled, and computes the pose to show once per frame, before the components that use
    /// it. It reads ZeroMQ on a thread of its own; in a WebGL build it reads the browser's web socket instead.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Receiver")]
    [DefaultExecutionOrder(-100)]
    public sealed class ManipNetReceiver : MonoBehaviour
    {
        [Tooltip("Address for hands in the server's line `ready`.")]
        [SerializeField] string address = "tcp://127.0.0.1:5555";

        [Tooltip("Address of the web socket in the server's line `ready`. Only WebGL builds use it, because a browser allows no other.")]
        [SerializeField] string webAddress = "ws://127.0.0.1:8081";

        [Tooltip("Actor whose hands are shown; empty for the first one received.")]
        [SerializeField] string actor = "";

        [Tooltip("Seconds by which the hands are shown late, to bridge jitter and lost frames. 0.05 is enough on one machine.")]
        [SerializeField, Range(0f, 0.5f)] float delay = 0.1f;

        readonly HandsFrame _hands = new HandsFrame();
        IHandsClient _client;
        string _connectedTo;
        float _weight;

        /// <summary>
        /// The pose to show in this frame, in the project's axes (right-handed); ManipNetPose converts it.
        /// </summary>
        public HandsFrame Hands
        {
            get { return _hands; }
        }

        public bool HasHands { get; private set; }

        /// <summary>The weight of the pose, which falls from 1 to 0 when the stream is lost.</summary>
        public float Weight
        {
            get { return _weight; }
        }

        public Stats Stats
        {
            get { return _client == null ? new Stats { State = "off" } : _client.GetStats(); }
        }

        /// <summary>The address for hands; a new one takes effect in the next frame.</summary>
        public string Address
        {
            get { return address; }
            set { address = value; }
        }

        /// <summary>The actor whose hands are shown; a new one takes effect in the next frame.</summary>
        public string Actor
        {
            get { return actor; }
            set { actor = value; }
        }

        /// <summary>The web socket for WebGL builds; a new one takes effect in the next frame.</summary>
        public string WebAddress
        {
            get { return webAddress; }
            set { webAddress = value; }
        }

        /// <summary>What the client was made for; it is made anew when that changes, as in the Inspector.</summary>
        string Wanted
        {
            get { return address + "\n" + webAddress + "\n" + actor; }
        }

        void OnEnable()
        {
            _connectedTo = Wanted;
            try
            {
                _client = Connect();
            }
            catch (ArgumentException error)
            {
                Debug.LogError("ManipNet: " + error.Message, this);
            }
        }

        IHandsClient Connect()
        {
#if UNITY_WEBGL && !UNITY_EDITOR
            return new WebSocketClient(new BrowserWebSocket(), webAddress, actor, delay);
#else
            return new ManipNetClient(address, actor, delay);
#endif
        }

        /// <summary>Unity also calls this before it reloads scripts, which the thread must not outlive.</summary>
        void OnDisable()
        {
            if (_client != null) _client.Dispose();
            _client = null;
            HasHands = false;
        }

        void OnValidate()
        {
            if (_client != null) _client.DelayS = delay;
        }

        void LateUpdate()
        {
            if (_connectedTo != Wanted)
            {
                OnDisable();
                OnEnable();
            }
            HasHands = _client != null && _client.Sample(LocalClock.Now, _hands, out _weight);
        }
    }
}
