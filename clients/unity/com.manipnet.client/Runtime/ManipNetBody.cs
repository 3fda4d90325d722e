using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>Moves this object with a tracked body, in step with the fingers that touch it.</summary>
    [AddComponentMenu("ManipNet/ManipNet Body")]
    [DefaultExecutionOrder(100)]
    public sealed class ManipNetBody : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;

        [Tooltip("Name of the body in the stream.")]
        [SerializeField] string body = "";

        void LateUpdate()
        {
            if (receiver == null || !receiver.HasHands) return;
            HandsFrame hands = receiver.Hands;
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
