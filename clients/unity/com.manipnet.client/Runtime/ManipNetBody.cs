using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>Moves this object with a tracked body, in step with the fingers that touch it.</summary>
    [AddComponentMenu("ManipNet/ManipNet Body")]
    [DefaultExecutionOrder(100)]
    public sealed class ManipNetBody : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;

        [Tooltip("Actor whose bodies are shown; empty for the receiver's.")]
        [SerializeField] string actor = "";


        [Tooltip("Name of the body in the stream.")]
        [SerializeField] string body = "";

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
                BodyFrame found = hands.Body(i);
                if (!found.Tracked || found.Name.Text != body) continue;
                transform.position = ManipNetPose.Position(found.Pose, 0);
                transform.rotation = ManipNetPose.Rotation(found.Pose, 0);
            }
        }
    }
}
