using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Moves the children whose names end in a joint's name, as L_IndexProximal does, with the 26 joints of a hand.
    /// Names and axes are those of Unity's XR Hands (+z to the finger tip, +y out of the back). Missing children are
    /// created.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Joints")]
    [DefaultExecutionOrder(100)]
    public sealed class ManipNetJoints : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;

        [Tooltip("Actor whose hand is shown; empty for the receiver's.")]
        [SerializeField] string actor = "";

        [SerializeField] Side side = Side.Right;

        [Tooltip("Object that is shown at every created joint; may be empty.")]
        [SerializeField] GameObject marker;

        [Tooltip("Diameter in metres of the sphere that is shown at every created joint if there is no marker; 0 for none.")]
        [SerializeField] float sphere;

        readonly Transform[] _joints = new Transform[Layout.JointCount];

        public void Configure(ManipNetReceiver from, Side which, GameObject shown, float sphereDiameter = 0f)
        {
            receiver = from;
            side = which;
            marker = shown;
            sphere = sphereDiameter;
        }

        /// <summary>The name of a joint in XR Hands, for example IndexProximal for index_proximal.</summary>
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
                if (_joints[i] == null) _joints[i] = Create(JointName(i));
            }
        }

        Transform Create(string jointName)
        {
            GameObject made = marker != null ? Instantiate(marker)
                : sphere > 0f ? GameObject.CreatePrimitive(PrimitiveType.Sphere) : new GameObject();
            if (marker == null && sphere > 0f) made.transform.localScale = sphere * Vector3.one;
            made.name = jointName;
            made.transform.SetParent(transform, false);
            return made.transform;
        }

        /// <summary>The actor whose hand is shown; empty for the receiver's.</summary>
        public string Actor
        {
            get { return actor; }
            set { actor = value; }
        }

        void LateUpdate()
        {
            HandsView view = receiver == null ? null : receiver.Of(actor);
            if (view == null || !view.HasHands || view.Weight <= 0f) return;
            HandFrame hand = view.Hands.Hand(side);
            if (!hand.Present) return;
            for (int k = 0; k < _joints.Length; k++)
            {
                int i = k < 2 ? 1 - k : k; // the wrist comes first, because it is the palm's parent in XR Hands
                _joints[i].position = ManipNetPose.Position(hand.Joints, 7 * i);
                _joints[i].rotation = ManipNetPose.Rotation(hand.Joints, 7 * i) * ManipNetPose.ForwardAlongBone;
            }
        }
    }
}
