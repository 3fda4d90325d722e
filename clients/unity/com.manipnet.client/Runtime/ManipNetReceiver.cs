using System;
using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Receives hands while it is enabled, of one actor or of several, and computes the poses to show once per frame, before
    /// the components that use them. It reads ZeroMQ on threads of its own; in a WebGL build it reads the browser's web
    /// socket instead.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Receiver")]
    [DefaultExecutionOrder(-100)]
    public sealed class ManipNetReceiver : MonoBehaviour
    {
        [Tooltip("Address for hands in the server's line `ready`.")]
        [SerializeField] string address = "tcp://127.0.0.1:5555";

        [Tooltip("Address of the web socket in the server's line `ready`. Only WebGL builds use it, because a browser allows no other.")]
        [SerializeField] string webAddress = "ws://127.0.0.1:8081";

        [Tooltip("Actor whose hands are shown; empty for the first one received. A component may name another actor.")]
        [SerializeField] string actor = "";

        [Tooltip("Seconds by which the hands are shown late, to bridge jitter and lost frames. 0.05 is enough on one machine.")]
        [SerializeField, Range(0f, 0.5f)] float delay = 0.1f;

        [Tooltip("The server solves contact on the bones of each character that this receiver drives, so that fingers which touch an object on the performer's hand touch it on the character's too. The wrists must follow the tracked ones (Wrist: Arm). Off: the fingers turn as the performer's do.")]
        [SerializeField] bool solveOnAvatar;

        [Tooltip("Address `control` in the server's line `ready`, to which the hands of the characters are sent.")]
        [SerializeField] string controlAddress = "tcp://127.0.0.1:5557";

        readonly Dictionary<string, HandsView> _views = new Dictionary<string, HandsView>();
        readonly AvatarStreams _avatars = new AvatarStreams();
        readonly HandsFrame _nothing = new HandsFrame();
        string _address, _webAddress, _actor, _controlAddress;
        bool _isOn, _solveOnAvatar;

        /// <summary>
        /// The pose to show in this frame, in the project's axes (right-handed); ManipNetPose converts it.
        /// </summary>
        public HandsFrame Hands
        {
            get
            {
                HandsView view = Of("");
                return view == null ? _nothing : view.Hands;
            }
        }

        public bool HasHands
        {
            get
            {
                HandsView view = Of("");
                return view != null && view.HasHands;
            }
        }

        /// <summary>The weight of the pose, which falls from 1 to 0 when the stream is lost.</summary>
        public float Weight
        {
            get
            {
                HandsView view = Of("");
                return view == null ? 0f : view.Weight;
            }
        }

        public Stats Stats
        {
            get
            {
                HandsView view = Of("");
                return view == null ? new Stats { State = "off" } : view.Stats;
            }
        }

        /// <summary>All streams that are received: of actors, and of avatars.</summary>
        public IEnumerable<HandsView> Views
        {
            get
            {
                foreach (HandsView view in _views.Values)
                    if (view != null) yield return view; // none if the address is wrong
                foreach (HandsView view in _avatars.Views) yield return view;
            }
        }

        /// <summary>The address for hands; a new one takes effect in the next frame.</summary>
        public string Address
        {
            get { return address; }
            set { address = value; }
        }

        /// <summary>The address to which hand profiles are sent; a new one takes effect in the next frame.</summary>
        public string ControlAddress
        {
            get { return controlAddress; }
            set { controlAddress = value; }
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

        /// <summary>Whether the server solves the hands on the characters' own bones; a change takes effect in the next frame.</summary>
        public bool SolveOnAvatar
        {
            get { return solveOnAvatar; }
            set { solveOnAvatar = value; }
        }

        /// <summary>The hands of an actor; an empty name means the receiver's own. Null while the receiver is off.</summary>
        public HandsView Of(string who)
        {
            if (!_isOn) return null;
            string name = string.IsNullOrEmpty(who) ? actor : who;
            HandsView view;
            if (!_views.TryGetValue(name, out view))
            {
                IHandsClient client = Connect(name);
                view = client == null ? null : new HandsView(name, client);
                _views.Add(name, view);
            }
            return view;
        }

        /// <summary>The hands that the server has solved on the character of `hand`; null if it does not.</summary>
        public HandsView OfAvatar(ManipNetHand hand)
        {
#if UNITY_WEBGL && !UNITY_EDITOR
            return null; // a browser has no way to the control port
#else
            if (!solveOnAvatar || !_isOn || Of(hand.Actor) == null) return null;
            return _avatars.Of(hand, address, controlAddress, string.IsNullOrEmpty(hand.Actor) ? actor : hand.Actor, delay);
#endif
        }

        public void Join(ManipNetHand hand)
        {
            _avatars.Join(hand);
        }

        public void Leave(ManipNetHand hand)
        {
            _avatars.Leave(hand);
        }

        /// <summary>Whether the clients were made for other settings, as after a change in the Inspector.</summary>
        bool Changed
        {
            get
            {
                return _address != address || _webAddress != webAddress || _actor != actor || _controlAddress != controlAddress
                    || _solveOnAvatar != solveOnAvatar;
            }
        }

        void OnEnable()
        {
            _isOn = true;
            _address = address;
            _webAddress = webAddress;
            _actor = actor;
            _controlAddress = controlAddress;
            _solveOnAvatar = solveOnAvatar;
            Of("");
        }

        IHandsClient Connect(string name)
        {
            try
            {
#if UNITY_WEBGL && !UNITY_EDITOR
                return new WebSocketClient(new BrowserWebSocket(), webAddress, name, delay);
#else
                if (solveOnAvatar) new ControlClient(controlAddress); // an address that cannot be right is told at once
                return new ManipNetClient(address, name, delay);
#endif
            }
            catch (ArgumentException error)
            {
                Debug.LogError("ManipNet: " + error.Message, this);
                return null;
            }
        }

        /// <summary>Unity also calls this before it reloads scripts, which the threads must not outlive.</summary>
        void OnDisable()
        {
            foreach (HandsView view in Views) view.Dispose();
            _views.Clear();
            _avatars.Clear();
            _isOn = false;
        }

        void OnValidate()
        {
            foreach (HandsView view in Views) view.DelayS = delay;
        }

        void LateUpdate()
        {
            if (Changed)
            {
                OnDisable();
                OnEnable();
            }
            foreach (HandsView view in _views.Values)
                if (view != null) view.Update();
            _avatars.Update();
        }
    }
}
