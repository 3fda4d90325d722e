using System.Collections.Generic;
using UnityEngine;
using UnityEngine.XR.Hands;

namespace ManipNet.Client.Unity
{
    /// <summary>Runs the XR Hands subsystem with the hands of a receiver while it is enabled.</summary>
    [AddComponentMenu("ManipNet/ManipNet XR Hands")]
    public sealed class ManipNetXRHands : MonoBehaviour
    {
        [SerializeField] ManipNetReceiver receiver;

        ManipNetHandSubsystem _subsystem;

        public void Configure(ManipNetReceiver from)
        {
            receiver = from;
            if (_subsystem != null) _subsystem.Source = from;
        }

        void OnEnable()
        {
            var descriptors = new List<XRHandSubsystemDescriptor>();
            SubsystemManager.GetSubsystemDescriptors(descriptors);
            foreach (XRHandSubsystemDescriptor descriptor in descriptors)
                if (descriptor.id == ManipNetHandSubsystem.Id) _subsystem = (ManipNetHandSubsystem)descriptor.Create();
            if (_subsystem == null)
            {
                Debug.LogError("ManipNet: the XR Hands subsystem is not registered", this);
                return;
            }
            _subsystem.Source = receiver;
            _subsystem.Start();
        }

        void OnDisable()
        {
            if (_subsystem == null) return;
            _subsystem.Stop();
            _subsystem.Destroy();
            _subsystem = null;
        }
    }
}
