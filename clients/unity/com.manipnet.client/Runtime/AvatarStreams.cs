using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// The hands that the server solves on the characters of a receiver: one stream for each pair of character and actor. The
    /// profiles are made of the hands that have joined.
    /// </summary>
    public sealed class AvatarStreams
    {
        sealed class Stream
        {
            public Transform Rig;
            public string Actor;
            public HandProfile Left, Right;
            public HandsView View;
        }

        readonly List<ManipNetHand> _hands = new List<ManipNetHand>();
        readonly List<Stream> _streams = new List<Stream>();

        public void Join(ManipNetHand hand)
        {
            if (!_hands.Contains(hand)) _hands.Add(hand);
        }

        public void Leave(ManipNetHand hand)
        {
            _hands.Remove(hand);
        }

        public void Update()
        {
            foreach (Stream stream in _streams) stream.View.Update();
        }

        public IEnumerable<HandsView> Views
        {
            get
            {
                foreach (Stream stream in _streams) yield return stream.View;
            }
        }

        /// <summary>The stream of the character of a hand; it is begun, or begun anew if the character's hands have changed.</summary>
        public HandsView Of(ManipNetHand hand, string address, string control, string actor, float delay)
        {
            HandProfile left = ProfileOf(hand, actor, Side.Left), right = ProfileOf(hand, actor, Side.Right);
            if (left == null && right == null) return null;
            Stream stream = Begun(hand.Rig, actor);
            if (stream != null && stream.Left == left && stream.Right == right) return stream.View;
            if (stream != null)
            {
                stream.View.Dispose();
                _streams.Remove(stream);
            }
            string name = HandProfile.NameFor(hand.Rig.name, actor, left, right);
            var client = new AvatarClient(address, control, name, HandProfile.Json(name, left, right), actor, delay);
            stream = new Stream { Rig = hand.Rig, Actor = actor, Left = left, Right = right, View = new HandsView(name, client) };
            _streams.Add(stream);
            return stream.View;
        }

        Stream Begun(Transform rig, string actor)
        {
            foreach (Stream stream in _streams)
                if (stream.Rig == rig && stream.Actor == actor) return stream;
            return null;
        }

        HandProfile ProfileOf(ManipNetHand like, string actor, Side side)
        {
            foreach (ManipNetHand hand in _hands)
                if (hand.Side == side && hand.Rig == like.Rig && hand.Actor == like.Actor && hand.Profile != null) return hand.Profile;
            return null;
        }

        /// <summary>Forgets the streams, which the receiver has closed.</summary>
        public void Clear()
        {
            _streams.Clear();
        }
    }
}
