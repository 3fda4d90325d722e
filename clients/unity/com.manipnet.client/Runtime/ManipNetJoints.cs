using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// The 26 joints of a hand, named and turned as in Unity's XR Hands (+z to the finger tip, +y out of the back), on
    /// children whose names end in the joint's name, as in L_IndexProximal. Missing ones are made.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Joints")]
    [DefaultExecutionOrder(100)]
    public sealed class ManipNetJoints : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;
        [SerializeField] Side side = Side.Right;

        [Tooltip("Shown at every joint that had to be made; may be empty.")]
        [SerializeField] GameObject marker;

        readonly Transform[] _joints = new Transform[Layout.JointCount];

        public void Configure(ManipNetReceiver from, Side which, GameObject shown)
        {
            receiver = from;
            side = which;
            marker = shown;
        }

        /// <summary>XR Hands' name of a joint: index_proximal is IndexProximal.</summary>
        public static string JointName(int joint)
        {
            string name = "";
            foreach (string word in Layout.JointNames[joint].Split('_')) name += char.ToUpperInvariant(word[0]) + word.Substring(1);
            return name;
        }

        void Start()
        {
            Transform[] all = GetComponentsInChildren<Transform>(true);
            for (int i = 0; i < _joints.Length; i++)
            {
                foreach (Transform t in all)
                    if (t.name.EndsWith(JointName(i), System.StringComparison.OrdinalIgnoreCase)) _joints[i] = t;
                if (_joints[i] == null) _joints[i] = Make(JointName(i));
            }
        }

        Transform Make(string jointName)
        {
            GameObject made = marker == null ? new GameObject() : Instantiate(marker);
            made.name = jointName;
            made.transform.SetParent(transform, false);
            return made.transform;
        }

        void LateUpdate()
        {
            if (receiver == null || !receiver.HasHands || receiver.Weight <= 0f) return;
            HandFrame hand = receiver.Hands.Hand(side);
            if (!hand.Present) return;
            for (int k = 0; k < _joints.Length; k++)
            {
                int i = k < 2 ? 1 - k : k; // the wrist before the palm, which hangs on it in XR Hands' rigs
                _joints[i].position = ManipNetPose.Position(hand.Joints, 7 * i);
                _joints[i].rotation = ManipNetPose.Rotation(hand.Joints, 7 * i) * ManipNetPose.ForwardAlongBone;
            }
        }
    }
}
