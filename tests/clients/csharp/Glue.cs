using System;
using System.Globalization;
using System.Linq;
using System.Reflection;
using System.Threading;
using ManipNet.Client;
using ManipNet.Client.Unity;
using UnityEditor;
using UnityEngine;

/// <summary>Runs the components on stubs of the engine with a live server: `glue ADDRESS`.</summary>
static class Glue
{
    static readonly Vector3[] Knuckles =
    {
        new Vector3(0.03f, 0.02f, -0.01f), new Vector3(0.09f, 0.025f, 0f), new Vector3(0.095f, 0f, 0f),
        new Vector3(0.09f, -0.02f, 0f), new Vector3(0.08f, -0.04f, 0f),
    };

    static readonly string[] Fingers = { "Thumb", "Index", "Middle", "Ring", "Pinky" };

    static int Main(string[] args)
    {
        Thread.CurrentThread.CurrentCulture = CultureInfo.InvariantCulture;
        if (args.Length > 2) return Actors(args[0], args.Skip(2).ToArray());
        if (args.Length > 1) return AvatarScene.Run(args[0], args[1]);
        var tests = new ManipNet.Client.Tests.DecoderTests();
        tests.RefusesOtherData();
        tests.NamesBothVersionsWhenItRefusesOne();

        var scene = new GameObject("scene");
        var receiver = scene.AddComponent<ManipNetReceiver>();
        receiver.Address = args[0];
        var animator = scene.AddComponent<Animator>();
        Transform hand = Skeleton(animator, "");
        var fingers = scene.AddComponent<ManipNetHand>();
        fingers.Configure(receiver, Side.Right, animator, null, WristMode.Arm);
        var joints = scene.AddComponent<ManipNetJoints>();
        joints.Configure(receiver, Side.Right, null);
        Transform named = Skeleton(null, "mixamorig:RightHand");
        var byName = scene.AddComponent<ManipNetHand>();
        byName.Configure(receiver, Side.Right, null, named, WristMode.Arm);
        var xr = new GameObject("R_Wrist").transform;
        var own = new GameObject("R_IndexTip").transform;
        own.SetParent(xr, false);
        var xrHand = xr.gameObject.AddComponent<ManipNetJoints>();
        xrHand.Configure(receiver, Side.Right, null);
        var nameless = scene.AddComponent<ManipNetHand>();
        nameless.Configure(receiver, Side.Left, null, scene.transform, WristMode.Keep);
        Call(receiver, "OnEnable");
        Call(joints, "Start");
        Call(xrHand, "Start");
        var prop = new GameObject("cube");
        var body = prop.AddComponent<ManipNetBody>();
        typeof(ManipNetBody).GetField("receiver", BindingFlags.NonPublic | BindingFlags.Instance).SetValue(body, receiver);
        typeof(ManipNetBody).GetField("body", BindingFlags.NonPublic | BindingFlags.Instance).SetValue(body, "cube");
        for (int i = 0; i < 1000 && (!receiver.HasHands || receiver.Weight < 1f); i++)
        {
            Thread.Sleep(10);
            Call(receiver, "LateUpdate");
        }
        foreach (MonoBehaviour shown in new MonoBehaviour[] { fingers, byName, joints, xrHand, body }) Call(shown, "LateUpdate");
        Print("wrist", receiver.Hands.Right.Wrist);
        Print("hand", Flat(hand));
        Print("joint", Flat(scene.transform.All().Last(t => t.name == "IndexProximal")));
        Print("body", Flat(prop.transform));
        Print("finger", Flat(animator.Bones[HumanBodyBones.RightThumbProximal + 5]));
        Print("byname", Flat(named.All().First(t => t.name.EndsWith("Index3"))));
        Print("xr", Flat(own));
        Print("palm", Flat(xr.All().First(t => t.name == "Palm")));
        Console.WriteLine("made " + xr.All().Count());
        Features.Run(receiver);
        Sample(args[0]);
        Window(args[0]);
        Call(receiver, "OnDisable");
        Console.WriteLine("state " + receiver.Stats.State);
        return 0;
    }

    /// <summary>
    /// Shows actors with one receiver: prints for each which hands it has, and where its right wrist and the joint of a component
    /// are.
    /// </summary>
    static int Actors(string address, string[] names)
    {
        var receiver = new GameObject("receiver").AddComponent<ManipNetReceiver>();
        receiver.Address = address;
        Call(receiver, "OnEnable");
        var joints = names.Select(name => new GameObject(name).AddComponent<ManipNetJoints>()).ToArray();
        for (int k = 0; k < names.Length; k++)
        {
            joints[k].Configure(receiver, Side.Right, null);
            joints[k].Actor = names[k];
            Call(joints[k], "Start");
        }
        for (int i = 0; i < 1000 && !names.All(name => receiver.Of(name).HasHands && receiver.Of(name).Weight == 1f); i++)
        {
            Thread.Sleep(10);
            Call(receiver, "LateUpdate");
        }
        foreach (ManipNetJoints hand in joints) Call(hand, "LateUpdate");
        for (int k = 0; k < names.Length; k++)
        {
            HandsFrame hands = receiver.Of(names[k]).Hands;
            Console.WriteLine(hands.Actor.Text + " " + hands.Left.Present + " " + hands.Right.Present);
            Print("wrist", Flat(joints[k].transform.All().First(t => t.name == "Wrist")));
            Vector3 place = ManipNetPose.Position(hands.Right.Joints, 7);
            Print("place", new[] { place.x, place.y, place.z });
        }
        Call(receiver, "OnDisable");
        return 0;
    }

    /// <summary>Runs the package's sample as in play mode.</summary>
    static void Sample(string address)
    {
        var place = new GameObject("sample");
        Call(place.AddComponent<HandsSample>(), "Start");
        place.GetComponent<ManipNetReceiver>().Address = address;
        Call(place.GetComponent<ManipNetReceiver>(), "OnEnable");
        for (int i = 0; i < 1000 && !place.GetComponent<ManipNetReceiver>().HasHands; i++)
        {
            Thread.Sleep(10);
            Call(place.GetComponent<ManipNetReceiver>(), "LateUpdate");
        }
        ManipNetJoints[] hands = place.GetComponentsInChildren();
        foreach (ManipNetJoints hand in hands) Call(hand, "Start");
        foreach (ManipNetJoints hand in hands) Call(hand, "LateUpdate");
        Console.WriteLine("sample " + hands.Length + " " + hands.Sum(hand => hand.transform.childCount));
        Call(place.GetComponent<ManipNetReceiver>(), "OnDisable");
    }

    static ManipNetJoints[] GetComponentsInChildren(this GameObject place)
    {
        return place.transform.All().Select(t => t.gameObject.GetComponent<ManipNetJoints>()).Where(found => found != null).ToArray();
    }

    /// <summary>Tests a wrong and the right address in the window, sets up a character, and stops the test.</summary>
    static void Window(string address)
    {
        var window = new ManipNetWindow();
        Call(window, "OnEnable");
        EditorGUILayout.Typed = "nowhere";
        Press(window, "Test connection");
        EditorGUILayout.Typed = address;
        Press(window, "Test connection");
        for (int i = 0; i < 1000 && !EditorGUILayout.Drawn.Any(line => line.StartsWith("Rate: ") && line != "Rate: 0.0 Hz"); i++)
        {
            Thread.Sleep(10);
            Press(window, null);
        }
        var character = new GameObject("character");
        Skeleton(character.AddComponent<Animator>(), "");
        Selection.activeGameObject = character;
        Press(window, "Add hands to the selected character");
        Press(window, "Add hands to the selected character");
        Console.WriteLine("twice " + character.GetComponents<ManipNetHand>().Length + " " + character.GetComponents<ManipNetReceiver>().Length
            + " " + Undo.Recorded.Contains(character.GetComponent<ManipNetReceiver>())
            + " " + PrefabUtility.Recorded.Contains(character.GetComponent<ManipNetReceiver>())
            + " " + PrefabUtility.Recorded.Contains(character.GetComponent<ManipNetHand>()));
        Press(window, "Stop test");
        Call(window, "OnDisable");
        int k = 0;
        foreach (string line in EditorGUILayout.Drawn.Distinct()) Console.WriteLine("drawn" + k++ + " " + line);
        Console.WriteLine("setup " + character.GetComponent<ManipNetReceiver>().Address + " " + (character.GetComponent<ManipNetHand>() != null));
    }

    static void Press(ManipNetWindow window, string button)
    {
        GUILayout.Pressed = button;
        Call(window, "OnGUI");
    }

    /// <summary>
    /// Creates a hand whose bones lie along x, as the model's do, in Unity's axes: of a Humanoid, or with bones named
    /// after `names`.
    /// </summary>
    public static Transform Skeleton(Animator animator, string names)
    {
        var hand = new GameObject(animator == null ? names : "RightHand").transform;
        if (animator != null) animator.Bones[HumanBodyBones.RightHand] = hand;
        for (int finger = 0; finger < 5; finger++)
        {
            Transform parent = hand;
            for (int part = 0; part < 3; part++)
            {
                var bone = new GameObject(animator == null ? names + Fingers[finger] + (part + 1) : "bone").transform;
                bone.SetParent(parent, false);
                Vector3 k = Knuckles[finger];
                bone.position = new Vector3(-k.x - 0.03f * part, k.y, k.z);
                if (animator != null) animator.Bones[HumanBodyBones.RightThumbProximal + 3 * finger + part] = bone;
                parent = bone;
            }
        }
        return hand;
    }

    public static void Call(object behaviour, string method)
    {
        behaviour.GetType().GetMethod(method, BindingFlags.NonPublic | BindingFlags.Instance).Invoke(behaviour, null);
    }

    public static float[] Flat(Transform t)
    {
        return new[] { t.position.x, t.position.y, t.position.z, t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w };
    }

    public static void Print(string what, float[] values)
    {
        Console.WriteLine(what + " " + string.Join(" ", values.Select(x => x.ToString("G9"))));
    }
}
