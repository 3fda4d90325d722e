using System;
using System.Collections.Generic;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>A recorded property of an object: a curve for an AnimationClip.</summary>
    public sealed class RecordedCurve
    {
        public readonly string Path;
        public readonly Type Type;
        public readonly string Property;
        public readonly AnimationCurve Curve = new AnimationCurve();

        public RecordedCurve(string path, Type type, string property)
        {
            Path = path;
            Type = type;
            Property = property;
        }
    }

    /// <summary>
    /// Records the hands of a character as curves of an AnimationClip, with the tracker's timecode. A Humanoid is recorded
    /// as muscles, so that the clip plays on every Humanoid; another rig as rotations of its bones. The editor window
    /// saves the clip.
    /// </summary>
    [AddComponentMenu("ManipNet/ManipNet Recorder")]
    [DefaultExecutionOrder(200)]
    public sealed class ManipNetRecorder : MonoBehaviour
    {
        /// <summary>The name of the clip's events that carry a timecode; nobody need receive them.</summary>
        public const string TimecodeEvent = "ManipNetTimecode";
        const int FirstFingerMuscle = 55, LastFingerMuscle = 94;
        static readonly string[] Axes = { "x", "y", "z", "w" };

        [SerializeField] ManipNetReceiver receiver;

        [Tooltip("Object that will play the clip, as the character with its Animator.")]
        [SerializeField] Transform root;

        readonly List<RecordedCurve> _curves = new List<RecordedCurve>();
        readonly List<Transform> _bones = new List<Transform>();
        readonly List<AnimationEvent> _events = new List<AnimationEvent>();
        HumanPoseHandler _muscles;
        HumanPose _pose;
        string _second;

        public void Configure(ManipNetReceiver from, Transform clipRoot)
        {
            receiver = from;
            root = clipRoot;
        }

        public bool IsRecording { get; private set; }

        /// <summary>Seconds since the beginning of the take.</summary>
        public float Length { get; private set; }

        /// <summary>The timecode of the first frame; null if the tracker sends none.</summary>
        public string FirstTimecode { get; private set; }

        public IList<RecordedCurve> Curves
        {
            get { return _curves; }
        }

        /// <summary>An event with the timecode at the first frame and at each second of it.</summary>
        public AnimationEvent[] Events
        {
            get { return _events.ToArray(); }
        }

        public void Begin()
        {
            Clear();
            var animator = root.GetComponent<Animator>();
            if (animator != null && animator.isHuman) FindMuscles(animator);
            else FindBones();
            IsRecording = true;
        }

        public void End()
        {
            IsRecording = false;
            if (_muscles != null) _muscles.Dispose();
            _muscles = null;
        }

        void OnDisable()
        {
            End();
        }

        void LateUpdate()
        {
            if (!IsRecording || !receiver.HasHands) return;
            if (_curves.Count > 0 && _curves[0].Curve.length > 0) Length += Time.deltaTime;
            if (_muscles != null) SampleMuscles();
            else SampleBones();
            NoteTimecode(receiver.Hands.Timecode.Text, receiver.Hands.TimecodeRate);
        }

        void Clear()
        {
            _curves.Clear();
            _bones.Clear();
            _events.Clear();
            Length = 0f;
            FirstTimecode = _second = null;
        }

        void FindMuscles(Animator animator)
        {
            _muscles = new HumanPoseHandler(animator.avatar, animator.transform);
            string[] names = HumanTrait.MuscleName;
            for (int i = FirstFingerMuscle; i <= LastFingerMuscle; i++)
                _curves.Add(new RecordedCurve("", typeof(Animator), MuscleProperty(names[i])));
        }

        /// <summary>
        /// The animated property of a finger's muscle, for example "LeftHand.Thumb.1 Stretched" for "Left Thumb 1 Stretched".
        /// </summary>
        public static string MuscleProperty(string muscle)
        {
            string[] words = muscle.Split(new[] { ' ' }, 3);
            return words[0] + "Hand." + words[1] + "." + words[2];
        }

        void FindBones()
        {
            foreach (ManipNetHand hand in root.GetComponentsInChildren<ManipNetHand>(true))
            {
                if (hand.Bones == null) continue;
                Add(hand.Bones.UpperArm);
                Add(hand.Bones.LowerArm);
                Add(hand.Bones.Hand);
                foreach (Transform finger in hand.Bones.Fingers) Add(finger);
            }
        }

        void Add(Transform bone)
        {
            if (bone == null || _bones.Contains(bone)) return;
            _bones.Add(bone);
            foreach (string axis in Axes)
                _curves.Add(new RecordedCurve(PathOf(bone), typeof(Transform), "m_LocalRotation." + axis));
        }

        string PathOf(Transform bone)
        {
            string path = bone.name;
            for (Transform t = bone.parent; t != null && t != root; t = t.parent) path = t.name + "/" + path;
            return path;
        }

        void SampleMuscles()
        {
            _muscles.GetHumanPose(ref _pose);
            for (int i = 0; i < _curves.Count; i++) _curves[i].Curve.AddKey(Length, _pose.muscles[FirstFingerMuscle + i]);
        }

        void SampleBones()
        {
            for (int i = 0; i < _bones.Count; i++)
            {
                Quaternion q = _bones[i].localRotation;
                if (Flipped(i, q)) q = new Quaternion(-q.x, -q.y, -q.z, -q.w);
                float[] values = { q.x, q.y, q.z, q.w };
                for (int axis = 0; axis < 4; axis++) _curves[4 * i + axis].Curve.AddKey(Length, values[axis]);
            }
        }

        /// <summary>Whether the quaternion has the other sign than the key before it; both mean the same rotation.</summary>
        bool Flipped(int bone, Quaternion q)
        {
            AnimationCurve x = _curves[4 * bone].Curve;
            if (x.length == 0) return false;
            int last = x.length - 1;
            float dot = 0f;
            float[] values = { q.x, q.y, q.z, q.w };
            for (int axis = 0; axis < 4; axis++) dot += values[axis] * _curves[4 * bone + axis].Curve[last].value;
            return dot < 0f;
        }

        void NoteTimecode(string timecode, float rate)
        {
            if (timecode.Length != 11 || timecode.Substring(0, 8) == _second) return;
            _second = timecode.Substring(0, 8);
            if (FirstTimecode == null) FirstTimecode = timecode;
            _events.Add(new AnimationEvent
            {
                time = Length,
                functionName = TimecodeEvent,
                stringParameter = timecode,
                floatParameter = rate,
                messageOptions = SendMessageOptions.DontRequireReceiver,
            });
        }
    }
}
