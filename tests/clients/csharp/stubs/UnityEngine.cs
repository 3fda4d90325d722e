// The types of the engine that the package uses, complete enough to run its components without Unity.
using System;
using System.Collections.Generic;
using System.Linq;

namespace UnityEngine
{
    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
        public static Vector3 zero { get { return new Vector3(0, 0, 0); } }
        public static Vector3 Scale(Vector3 a, Vector3 b) { return new Vector3(a.x * b.x, a.y * b.y, a.z * b.z); }
        public static Vector3 one { get { return new Vector3(1, 1, 1); } }
        public static Vector3 down { get { return new Vector3(0, -1, 0); } }
        public static Vector3 operator +(Vector3 a, Vector3 b) { return new Vector3(a.x + b.x, a.y + b.y, a.z + b.z); }
        public static Vector3 operator -(Vector3 a, Vector3 b) { return new Vector3(a.x - b.x, a.y - b.y, a.z - b.z); }
        public static Vector3 operator *(float s, Vector3 v) { return new Vector3(s * v.x, s * v.y, s * v.z); }
        public static Vector3 Lerp(Vector3 a, Vector3 b, float t) { return a + t * (b - a); }
    }

    public struct Quaternion
    {
        public float x, y, z, w;
        public Quaternion(float x, float y, float z, float w) { this.x = x; this.y = y; this.z = z; this.w = w; }
        public static Quaternion identity { get { return new Quaternion(0, 0, 0, 1); } }
        public static Quaternion Inverse(Quaternion q) { return new Quaternion(-q.x, -q.y, -q.z, q.w); }
        public static Quaternion operator *(Quaternion a, Quaternion b)
        {
            return new Quaternion(
                a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
                a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
                a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z);
        }
        public static Vector3 operator *(Quaternion q, Vector3 v)
        {
            Quaternion r = q * new Quaternion(v.x, v.y, v.z, 0) * Inverse(q);
            return new Vector3(r.x, r.y, r.z);
        }
        public static Quaternion Slerp(Quaternion a, Quaternion b, float t)
        {
            float s = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w < 0 ? -t : t;
            var q = new Quaternion(a.x * (1 - t) + b.x * s, a.y * (1 - t) + b.y * s, a.z * (1 - t) + b.z * s, a.w * (1 - t) + b.w * s);
            float n = (float)Math.Sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
            return new Quaternion(q.x / n, q.y / n, q.z / n, q.w / n);
        }
    }

    public class Object
    {
        string _name = "";
        public virtual string name { get { return _name; } set { _name = value; } }
        public static GameObject Instantiate(GameObject original) { return new GameObject(original.name); }
    }

    public class Component : Object
    {
        public GameObject gameObject;
        public override string name { get { return gameObject.name; } set { gameObject.name = value; } }
        public Transform transform { get { return gameObject.transform; } }
        public T GetComponent<T>() where T : Component { return gameObject.GetComponent<T>(); }
        public T[] GetComponentsInChildren<T>(bool inactive) where T : Component
        {
            return transform.All().SelectMany(t => t.gameObject.GetComponents<T>()).ToArray();
        }
    }

    public class Behaviour : Component
    {
        public bool enabled = true;
        public bool isActiveAndEnabled { get { return enabled; } }
    }

    public class MonoBehaviour : Behaviour { }

    public sealed class Transform : Component
    {
        readonly List<Transform> _children = new List<Transform>();
        Transform _parent;
        Vector3 _local;
        Quaternion _turn = Quaternion.identity;
        public Vector3 localScale = Vector3.one;
        public Transform parent { get { return _parent; } }
        public Vector3 localPosition { get { return _local; } set { _local = value; } }
        public Quaternion localRotation { get { return _turn; } set { _turn = value; } }
        public int childCount { get { return _children.Count; } }
        public Vector3 lossyScale { get { return _parent == null ? localScale : Vector3.Scale(_parent.lossyScale, localScale); } }
        public bool IsChildOf(Transform parent) { return this == parent || _parent != null && _parent.IsChildOf(parent); }
        public Transform GetChild(int i) { return _children[i]; }
        public void SetParent(Transform parent, bool keepWorld) { _parent = parent; parent._children.Add(this); }
        public IEnumerable<Transform> All() { return new[] { this }.Concat(_children.SelectMany(c => c.All())); }
        public Vector3 position
        {
            get { return _parent == null ? _local : _parent.position + _parent.rotation * Vector3.Scale(_parent.lossyScale, _local); }
            set { _local = _parent == null ? value : Divided(Quaternion.Inverse(_parent.rotation) * (value - _parent.position), _parent.lossyScale); }
        }
        static Vector3 Divided(Vector3 v, Vector3 by) { return new Vector3(v.x / by.x, v.y / by.y, v.z / by.z); }
        public Quaternion rotation
        {
            get { return _parent == null ? _turn : _parent.rotation * _turn; }
            set { _turn = _parent == null ? value : Quaternion.Inverse(_parent.rotation) * value; }
        }
    }

    public sealed class GameObject : Object
    {
        public static readonly List<Component> Everything = new List<Component>();
        readonly List<Component> _components = new List<Component>();
        public GameObject(string name = "") { this.name = name; AddComponent<Transform>(); }
        public Transform transform { get { return (Transform)_components[0]; } }
        public T GetComponent<T>() where T : Component { return _components.OfType<T>().FirstOrDefault(); }
        public T AddComponent<T>() where T : Component, new()
        {
            var made = new T { gameObject = this };
            _components.Add(made);
            Everything.Add(made);
            return made;
        }
        public T[] GetComponents<T>() { return _components.OfType<T>().ToArray(); }
        public bool activeSelf = true;
        public void SetActive(bool active) { activeSelf = active; }
        public static GameObject CreatePrimitive(PrimitiveType type) { return new GameObject(type.ToString()); }
    }

    public enum PrimitiveType { Sphere = 0, Cube = 3 }

    public enum HumanBodyBones
    {
        LeftUpperArm = 13, RightUpperArm = 14, LeftLowerArm = 15, RightLowerArm = 16, LeftHand = 17, RightHand = 18,
        LeftThumbProximal = 24, RightThumbProximal = 39,
    }

    public sealed class TextAsset : Object
    {
        public TextAsset(string text) { this.text = text; }
        public string text { get; private set; }
    }

    public struct SkeletonBone
    {
        public string name;
        public Vector3 position;
        public Quaternion rotation;
        public Vector3 scale;
    }

    public struct HumanDescription { public SkeletonBone[] skeleton; }

    public class Avatar : Object { public HumanDescription humanDescription { get; set; } }

    public struct HumanPose { public float[] muscles; }

    public class HumanPoseHandler : IDisposable
    {
        public HumanPoseHandler(Avatar avatar, Transform root) { }
        public void GetHumanPose(ref HumanPose pose) { pose.muscles = Enumerable.Range(0, 95).Select(i => 0.01f * i).ToArray(); }
        public void Dispose() { }
    }

    /// <summary>The names of the fingers' muscles have the places that they have in Unity.</summary>
    public static class HumanTrait
    {
        public static string[] MuscleName
        {
            get
            {
                var names = new string[95];
                string[] parts = { "1 Stretched", "Spread", "2 Stretched", "3 Stretched" };
                for (int i = 0; i < 40; i++)
                    names[55 + i] = (i < 20 ? "Left " : "Right ") + new[] { "Thumb", "Index", "Middle", "Ring", "Little" }[i % 20 / 4] + " " + parts[i % 4];
                return names;
            }
        }
    }

    public struct Keyframe { public float time, value; }

    public class AnimationCurve
    {
        readonly List<Keyframe> _keys = new List<Keyframe>();
        public int AddKey(float time, float value)
        {
            _keys.Add(new Keyframe { time = time, value = value });
            return _keys.Count - 1;
        }
        public int length { get { return _keys.Count; } }
        public Keyframe this[int index] { get { return _keys[index]; } }
    }

    public enum SendMessageOptions { RequireReceiver, DontRequireReceiver }

    public sealed class AnimationEvent
    {
        public float time { get; set; }
        public string functionName { get; set; }
        public string stringParameter { get; set; }
        public float floatParameter { get; set; }
        public SendMessageOptions messageOptions { get; set; }
    }

    public sealed class AnimationClip : Object { public float frameRate { get; set; } }

    public static class Time { public static float deltaTime { get { return 1f / 60f; } } }

    public struct Pose
    {
        public Vector3 position;
        public Quaternion rotation;
        public Pose(Vector3 position, Quaternion rotation) { this.position = position; this.rotation = rotation; }
    }

    public enum RuntimeInitializeLoadType { AfterSceneLoad, SubsystemRegistration }

    public sealed class RuntimeInitializeOnLoadMethodAttribute : Attribute
    {
        public RuntimeInitializeOnLoadMethodAttribute(RuntimeInitializeLoadType type) { }
    }

    public sealed class Animator : Behaviour
    {
        public readonly Dictionary<HumanBodyBones, Transform> Bones = new Dictionary<HumanBodyBones, Transform>();
        public Avatar avatar { get; set; }
        public bool isHuman { get { return Bones.Count > 0; } }
        public Transform GetBoneTransform(HumanBodyBones bone) { Transform t; Bones.TryGetValue(bone, out t); return t; }
    }

    public static class Debug
    {
        public static void LogError(object message, Object about) { Console.WriteLine("error: " + message); }
        public static void LogWarning(object message, Object about) { Console.WriteLine("warning: " + message); }
    }

    public static class Resources
    {
        public static T[] FindObjectsOfTypeAll<T>() { return GameObject.Everything.OfType<T>().ToArray(); }
    }

    /// <summary>Setting Pressed presses the button of that name once.</summary>
    public static class GUILayout
    {
        public static string Pressed;
        public static bool Button(string text)
        {
            if (text != Pressed) return false;
            Pressed = null;
            return true;
        }
    }

    [AttributeUsage(AttributeTargets.Field)] public sealed class SerializeField : Attribute { }
    public sealed class TooltipAttribute : Attribute { public TooltipAttribute(string text) { } }
    public sealed class RangeAttribute : Attribute { public RangeAttribute(float low, float high) { } }
    public sealed class AddComponentMenu : Attribute { public AddComponentMenu(string path) { } }
    public sealed class DefaultExecutionOrder : Attribute { public DefaultExecutionOrder(int order) { } }
}
