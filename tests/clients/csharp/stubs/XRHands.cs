// The types of com.unity.xr.hands that the package uses, complete enough to run its provider.
using System;
using System.Collections.Generic;
using Unity.Collections;
using UnityEngine.XR.Hands;

namespace Unity.Collections
{
    public struct NativeArray<T> where T : struct
    {
        readonly T[] _items;
        public NativeArray(int length) { _items = new T[length]; }
        public T this[int index] { get { return _items[index]; } set { _items[index] = value; } }
        public int Length { get { return _items.Length; } }
    }
}

namespace UnityEngine.Scripting
{
    public sealed class PreserveAttribute : Attribute { }
}

namespace UnityEngine
{
    public static class SubsystemManager
    {
        public static void GetSubsystemDescriptors<T>(List<T> descriptors)
        {
            foreach (XRHandSubsystemDescriptor known in XRHandSubsystemDescriptor.Known) descriptors.Add((T)(object)known);
        }
    }
}

namespace UnityEngine.XR.Hands
{
    public enum Handedness { Invalid, Left, Right }

    public enum XRHandJointTrackingState { None = 0, Pose = 1, Radius = 2 }

    public enum XRHandJointID { Invalid, BeginMarker = 1, Wrist = 1, Palm = 2, ThumbMetacarpal = 3, LittleTip = 26, EndMarker = 27 }

    public static class XRHandJointIDUtility
    {
        public static XRHandJointID FromIndex(int index) { return (XRHandJointID)(index + 1); }
        public static int ToIndex(this XRHandJointID id) { return (int)id - 1; }
    }

    public struct XRHandJoint
    {
        public XRHandJointID id;
        public Handedness handedness;
        public Pose Pose;
        public bool TryGetPose(out Pose pose) { pose = Pose; return true; }
    }

    public class XRHandSubsystemDescriptor
    {
        public static readonly List<XRHandSubsystemDescriptor> Known = new List<XRHandSubsystemDescriptor>();
        Cinfo _info;
        public string id { get { return _info.id; } }

        public struct Cinfo
        {
            public string id { get; set; }
            public Type providerType { get; set; }
            public Type subsystemTypeOverride { get; set; }
        }

        public static void Register(Cinfo cinfo) { Known.Add(new XRHandSubsystemDescriptor { _info = cinfo }); }

        public XRHandSubsystem Create()
        {
            var made = (XRHandSubsystem)Activator.CreateInstance(_info.subsystemTypeOverride);
            made.Initialize((ProviderImplementation.XRHandSubsystemProvider)Activator.CreateInstance(_info.providerType));
            return made;
        }
    }

    public class XRHandSubsystem
    {
        public enum UpdateType { Dynamic, BeforeRender }

        [Flags]
        public enum UpdateSuccessFlags
        {
            None = 0, LeftHandRootPose = 1, LeftHandJoints = 2, RightHandRootPose = 4, RightHandJoints = 8,
            All = 15,
        }

        public readonly NativeArray<XRHandJoint> Left = new NativeArray<XRHandJoint>(26);
        public readonly NativeArray<XRHandJoint> Right = new NativeArray<XRHandJoint>(26);
        public Pose LeftRoot, RightRoot;
        public bool running { get; private set; }
        protected ProviderImplementation.XRHandSubsystemProvider provider { get; private set; }

        internal void Initialize(ProviderImplementation.XRHandSubsystemProvider made) { provider = made; OnCreate(); }
        public void Start() { running = true; OnStart(); }
        public void Stop() { running = false; OnStop(); }
        public void Destroy() { OnDestroy(); }
        protected virtual void OnCreate() { }
        protected virtual void OnStart() { provider.Start(); }
        protected virtual void OnStop() { provider.Stop(); }
        protected virtual void OnDestroy() { provider.Destroy(); }

        public UpdateSuccessFlags TryUpdateHands(UpdateType type)
        {
            return provider.TryUpdateHands(type, ref LeftRoot, Left, ref RightRoot, Right);
        }
    }
}

namespace UnityEngine.XR.Hands.ProviderImplementation
{
    public abstract class XRHandSubsystemProvider
    {
        public abstract void Start();
        public abstract void Stop();
        public abstract void Destroy();
        public abstract void GetHandLayout(NativeArray<bool> handJointsInLayout);
        public abstract XRHandSubsystem.UpdateSuccessFlags TryUpdateHands(XRHandSubsystem.UpdateType updateType,
            ref Pose leftHandRootPose, NativeArray<XRHandJoint> leftHandJoints,
            ref Pose rightHandRootPose, NativeArray<XRHandJoint> rightHandJoints);
    }

    public static class XRHandProviderUtility
    {
        public class SubsystemUpdater
        {
            public static int Running;
            public SubsystemUpdater(XRHandSubsystem subsystem) { }
            public void Start() { Running++; }
            public void Stop() { Running--; }
            public void Destroy() { }
        }

        public static XRHandJoint CreateJoint(Handedness handedness, XRHandJointTrackingState trackingState, XRHandJointID id, Pose pose,
            float radius = 0f, Vector3 linearVelocity = new Vector3(), Vector3 angularVelocity = new Vector3())
        {
            return new XRHandJoint { id = id, handedness = handedness, Pose = pose };
        }
    }
}
