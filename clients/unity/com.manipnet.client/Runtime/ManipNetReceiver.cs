using System;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Receives hands on its own thread while it is enabled, and computes the pose to show once per frame, before the
    /// components that use it.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Receiver")]
    [DefaultExecutionOrder(-100)]
    public sealed class ManipNetReceiver : MonoBehaviour
    {
        [Tooltip("Address for hands in the server's line `ready`.")]
        [SerializeField] string address = "tcp://127.0.0.1:5555";

        [Tooltip("Actor whose hands are shown; empty for the first one received.")]
        [SerializeField] string actor = "";

        [Tooltip("Seconds by which the hands are shown late, to bridge jitter and lost frames. 0.05 is enough on one machine.")]
        [SerializeField, Range(0f, 0.5f)] float delay = 0.1f;

        readonly HandsFrame _hands = new HandsFrame();
        ManipNetClient _client;
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

        public string Address
        {
            get { return address; }
            set
            {
                address = value;
                if (_client == null) return;
                OnDisable();
                OnEnable();
            }
        }

        void OnEnable()
        {
            try
            {
                _client = new ManipNetClient(address, actor, delay);
            }
            catch (ArgumentException error)
            {
                Debug.LogError("ManipNet: " + error.Message, this);
                enabled = false;
            }
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
            HasHands = _client != null && _client.Sample(LocalClock.Now, _hands, out _weight);
        }
    }
}
