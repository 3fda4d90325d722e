using System;
using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>What is shown for a tracked body.</summary>
    [Serializable]
    public struct Prop
    {
        [Tooltip("Name of the body in the stream.")]
        public string body;

        [Tooltip("Object that is made for it.")]
        public GameObject prefab;
    }

    /// <summary>Makes an object for every tracked body and moves it, in step with the fingers that touch it.</summary>
    [AddComponentMenu("ManipNet/ManipNet Bodies")]
    [DefaultExecutionOrder(100)]
    public sealed class ManipNetBodies : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;

        [Tooltip("Actor whose bodies are shown; empty for the receiver's.")]
        [SerializeField] string actor = "";

        [SerializeField] Prop[] props = new Prop[0];

        [Tooltip("Edge in metres of the cube that is shown for a body without a prefab; 0 shows nothing.")]
        [SerializeField] float cube = 0.05f;

        readonly Dictionary<string, GameObject> _shown = new Dictionary<string, GameObject>();

        public void Configure(ManipNetReceiver from, Prop[] prefabs, float cubeEdge)
        {
            receiver = from;
            props = prefabs;
            cube = cubeEdge;
        }

        /// <summary>The actor whose bodies are shown; empty for the receiver's.</summary>
        public string Actor
        {
            get { return actor; }
            set { actor = value; }
        }

        void LateUpdate()
        {
            HandsView view = receiver == null ? null : receiver.Of(actor);
            if (view == null || !view.HasHands) return;
            HandsFrame hands = view.Hands;
            for (int i = 0; i < hands.BodyCount; i++)
            {
                BodyFrame body = hands.Body(i);
                GameObject shown = ShownFor(body.Name.Text);
                if (shown == null) continue;
                shown.SetActive(body.Tracked);
                shown.transform.position = ManipNetPose.Position(body.Pose, 0);
                shown.transform.rotation = ManipNetPose.Rotation(body.Pose, 0);
            }
        }

        GameObject ShownFor(string body)
        {
            GameObject shown;
            if (_shown.TryGetValue(body, out shown)) return shown;
            shown = Make(body);
            if (shown != null)
            {
                shown.name = body;
                shown.transform.SetParent(transform, false);
            }
            _shown[body] = shown;
            return shown;
        }

        GameObject Make(string body)
        {
            foreach (Prop prop in props)
                if (prop.body == body && prop.prefab != null) return Instantiate(prop.prefab);
            if (cube <= 0f) return null;
            GameObject made = GameObject.CreatePrimitive(PrimitiveType.Cube);
            made.transform.localScale = cube * Vector3.one;
            return made;
        }
    }
}
