using System;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// One of the streams that a receiver shows: the hands of an actor, or those that the server has solved on an avatar.
    /// The receiver computes the pose to show once per frame.
    /// </summary>
    public sealed class HandsView : IDisposable
    {
        readonly IHandsClient _client;
        float _weight;

        public HandsView(string name, IHandsClient client)
        {
            Name = name;
            _client = client;
        }

        /// <summary>The actor, or the name of the avatar's profile; empty for the first actor received.</summary>
        public string Name { get; private set; }

        /// <summary>The pose to show in this frame, in the project's axes (right-handed); ManipNetPose converts it.</summary>
        public readonly HandsFrame Hands = new HandsFrame();

        public bool HasHands { get; private set; }

        /// <summary>The weight of the pose, which falls from 1 to 0 when the stream is lost.</summary>
        public float Weight
        {
            get { return _weight; }
        }

        public Stats Stats
        {
            get { return _client.GetStats(); }
        }

        public double DelayS
        {
            set { _client.DelayS = value; }
        }

        public void Update()
        {
            HasHands = _client.Sample(LocalClock.Now, Hands, out _weight);
        }

        public void Dispose()
        {
            _client.Dispose();
        }
    }
}
