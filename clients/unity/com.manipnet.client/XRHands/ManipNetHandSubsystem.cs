using Unity.Collections;
using UnityEngine;
using UnityEngine.Scripting;
using UnityEngine.XR.Hands;
using UnityEngine.XR.Hands.ProviderImplementation;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Offers the hands to everything that reads Unity's XR Hands: the XR Interaction Toolkit, gestures, hand visualisers.
    /// ManipNetXRHands creates and starts it.
    /// </summary>
    public sealed class ManipNetHandSubsystem : XRHandSubsystem
    {
        public const string Id = "ManipNet Hands";
        XRHandProviderUtility.SubsystemUpdater _updater;

        /// <summary>Where the hands come from; null for none.</summary>
        public ManipNetReceiver Source
        {
            get { return ((ManipNetHandProvider)provider).Source; }
            set { ((ManipNetHandProvider)provider).Source = value; }
        }

        [RuntimeInitializeOnLoadMethod(RuntimeInitializeLoadType.SubsystemRegistration)]
        static void Register()
        {
            XRHandSubsystemDescriptor.Register(new XRHandSubsystemDescriptor.Cinfo
            {
                id = Id,
                providerType = typeof(ManipNetHandProvider),
                subsystemTypeOverride = typeof(ManipNetHandSubsystem),
            });
        }

        protected override void OnCreate()
        {
            base.OnCreate();
            _updater = new XRHandProviderUtility.SubsystemUpdater(this);
        }

        protected override void OnStart()
        {
            _updater.Start();
            base.OnStart();
        }

        protected override void OnStop()
        {
            _updater.Stop();
            base.OnStop();
        }

        protected override void OnDestroy()
        {
            _updater.Destroy();
            _updater = null;
            base.OnDestroy();
        }
    }

    /// <summary>Fills the joints of both hands from a receiver.</summary>
    [Preserve]
    public sealed class ManipNetHandProvider : XRHandSubsystemProvider
    {
        public ManipNetReceiver Source;

        public override void Start() { }

        public override void Stop() { }

        public override void Destroy() { }

        public override void GetHandLayout(NativeArray<bool> handJointsInLayout)
        {
            for (int i = 0; i < Layout.JointCount; i++) handJointsInLayout[i] = true;
        }

        public override XRHandSubsystem.UpdateSuccessFlags TryUpdateHands(XRHandSubsystem.UpdateType updateType,
            ref Pose leftHandRootPose, NativeArray<XRHandJoint> leftHandJoints,
            ref Pose rightHandRootPose, NativeArray<XRHandJoint> rightHandJoints)
        {
            XRHandSubsystem.UpdateSuccessFlags done = XRHandSubsystem.UpdateSuccessFlags.None;
            if (Source == null || !Source.HasHands || Source.Weight <= 0f) return done;
            if (Fill(Source.Hands.Left, Handedness.Left, ref leftHandRootPose, leftHandJoints))
                done |= XRHandSubsystem.UpdateSuccessFlags.LeftHandRootPose | XRHandSubsystem.UpdateSuccessFlags.LeftHandJoints;
            if (Fill(Source.Hands.Right, Handedness.Right, ref rightHandRootPose, rightHandJoints))
                done |= XRHandSubsystem.UpdateSuccessFlags.RightHandRootPose | XRHandSubsystem.UpdateSuccessFlags.RightHandJoints;
            return done;
        }

        static bool Fill(HandFrame hand, Handedness which, ref Pose root, NativeArray<XRHandJoint> joints)
        {
            if (!hand.Present) return false;
            for (int k = 0; k < Layout.JointCount; k++)
            {
                int i = k < 2 ? 1 - k : k; // XR Hands has the wrist before the palm
                var pose = new Pose(ManipNetPose.Position(hand.Joints, 7 * i), ManipNetPose.Rotation(hand.Joints, 7 * i) * ManipNetPose.ForwardAlongBone);
                if (k == 0) root = pose;
                joints[k] = XRHandProviderUtility.CreateJoint(which, XRHandJointTrackingState.Pose, XRHandJointIDUtility.FromIndex(k), pose);
            }
            return true;
        }
    }
}
