using System;
using System.Globalization;
using System.Linq;
using System.Reflection;
using System.Threading;
using ManipNet.Client;
using ManipNet.Client.Unity;
using UnityEngine;

/// <summary>Runs the components on working stubs of the engine against a live server: `glue ADDRESS`.</summary>
static class Glue
{
    static readonly Vector3[] Knuckles =
    {
        new Vector3(0.03f, 0.02f, -0.01f), new Vector3(0.09f, 0.025f, 0f), new Vector3(0.095f, 0f, 0f),
        new Vector3(0.09f, -0.02f, 0f), new Vector3(0.08f, -0.04f, 0f),
    };

    static int Main(string[] args)
    {
        Thread.CurrentThread.CurrentCulture = CultureInfo.InvariantCulture;
        var tests = new ManipNet.Client.Tests.DecoderTests();
        tests.RefusesWhatIsNoMessage();
        tests.RefusesAnotherVersionNamingBoth();

        var scene = new GameObject("scene");
        var receiver = scene.AddComponent<ManipNetReceiver>();
        receiver.Address = args[0];
        var animator = scene.AddComponent<Animator>();
        Transform hand = Skeleton(animator);
        var fingers = scene.AddComponent<ManipNetHand>();
        fingers.Configure(receiver, Side.Right, animator, null, true);
        var joints = scene.AddComponent<ManipNetJoints>();
        joints.Configure(receiver, Side.Right, null);
        var nameless = scene.AddComponent<ManipNetHand>();
        nameless.Configure(receiver, Side.Left, null, scene.transform, false);
        Call(receiver, "OnEnable");
        Call(joints, "Start");
        var prop = new GameObject("cube");
        var body = prop.AddComponent<ManipNetBody>();
        typeof(ManipNetBody).GetField("receiver", BindingFlags.NonPublic | BindingFlags.Instance).SetValue(body, receiver);
        typeof(ManipNetBody).GetField("body", BindingFlags.NonPublic | BindingFlags.Instance).SetValue(body, "cube");
        for (int i = 0; i < 1000 && (!receiver.HasHands || receiver.Stats.Received < 10); i++)
        {
            Thread.Sleep(10);
            Call(receiver, "LateUpdate");
        }
        foreach (MonoBehaviour shown in new MonoBehaviour[] { fingers, joints, body }) Call(shown, "LateUpdate");
        Print("wrist", receiver.Hands.Right.Wrist);
        Print("hand", Flat(hand));
        Print("joint", Flat(scene.transform.All().Last(t => t.name == "IndexProximal")));
        Print("body", Flat(prop.transform));
        Call(receiver, "OnDisable");
        Console.WriteLine("state " + receiver.Stats.State);
        return 0;
    }

    /// <summary>A hand whose bones lie along x, as ours, mirrored into Unity's axes.</summary>
    static Transform Skeleton(Animator animator)
    {
        var hand = new GameObject("RightHand").transform;
        animator.Bones[HumanBodyBones.RightHand] = hand;
        for (int finger = 0; finger < 5; finger++)
        {
            Transform parent = hand;
            for (int part = 0; part < 3; part++)
            {
                var bone = new GameObject("bone").transform;
                bone.SetParent(parent, false);
                Vector3 k = Knuckles[finger];
                bone.position = new Vector3(-k.x - 0.03f * part, k.y, k.z);
                animator.Bones[HumanBodyBones.RightThumbProximal + 3 * finger + part] = bone;
                parent = bone;
            }
        }
        return hand;
    }

    static void Call(MonoBehaviour behaviour, string method)
    {
        behaviour.GetType().GetMethod(method, BindingFlags.NonPublic | BindingFlags.Instance).Invoke(behaviour, null);
    }

    static float[] Flat(Transform t)
    {
        return new[] { t.position.x, t.position.y, t.position.z, t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w };
    }

    static void Print(string what, float[] values)
    {
        Console.WriteLine(what + " " + string.Join(" ", values.Select(x => x.ToString("G9"))));
    }
}
