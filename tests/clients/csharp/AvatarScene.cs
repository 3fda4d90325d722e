using System;
using System.Collections.Generic;
using System.Globalization;
using System.Linq;
using System.Threading;
using ManipNet.Client;
using ManipNet.Client.Unity;
using UnityEditor;
using UnityEngine;

/// <summary>
/// Puts hands on a character by the components, on stubs of the engine, with "Solve on this avatar" ticked: `glue HANDS
/// CONTROL`. The first line has the character's scale and the number of its bones; each further one a name, the parent's
/// number, and position and rotation in the world in Unity's axes. Then each line is answered by the places of all bones and
/// the joints of both hands, and by what the window shows.
/// </summary>
static class AvatarScene
{
    public static int Run(string hands, string control)
    {
        List<Transform> bones = ReadRig();
        var receiver = new GameObject("receiver").AddComponent<ManipNetReceiver>();
        receiver.Address = hands;
        receiver.ControlAddress = control;
        receiver.SolveOnAvatar = true;
        var fingers = new List<ManipNetHand>();
        var output = Console.Out;
        Console.SetOut(Console.Error); // for warnings about missing bones
        foreach (Side side in new[] { Side.Left, Side.Right })
        {
            var hand = bones[0].gameObject.AddComponent<ManipNetHand>();
            hand.Configure(receiver, side, null, bones[0], WristMode.Arm);
            fingers.Add(hand);
        }
        Console.SetOut(output);
        Glue.Call(receiver, "OnEnable");
        while (Console.ReadLine() != null)
        {
            Glue.Call(receiver, "LateUpdate");
            foreach (ManipNetHand hand in fingers) Glue.Call(hand, "LateUpdate");
            Print(receiver, receiver.OfAvatar(fingers[0]), bones);
        }
        foreach (ManipNetHand hand in fingers) Glue.Call(hand, "OnDisable");
        Glue.Call(receiver, "OnDisable");
        Console.WriteLine("closed");
        return 0;
    }

    static List<Transform> ReadRig()
    {
        string[] first = Console.ReadLine().Split(' ');
        float scale = float.Parse(first[0], CultureInfo.InvariantCulture);
        var bones = new List<Transform>();
        for (int i = 0; i < int.Parse(first[1]); i++)
        {
            string[] words = Console.ReadLine().Split('\t');
            float[] x = words.Skip(2).Select(word => float.Parse(word, CultureInfo.InvariantCulture)).ToArray();
            var bone = new GameObject(words[0]).transform;
            int parent = int.Parse(words[1]);
            if (parent >= 0) bone.SetParent(bones[parent], false);
            else bone.localScale = scale * Vector3.one;
            bone.position = new Vector3(x[0], x[1], x[2]);
            bone.rotation = new Quaternion(x[3], x[4], x[5], x[6]);
            bones.Add(bone);
        }
        return bones;
    }

    static void Print(ManipNetReceiver receiver, HandsView view, List<Transform> bones)
    {
        EditorGUILayout.Drawn.Clear();
        ManipNetInspectors.Show(receiver);
        string drawn = string.Join(" | ", EditorGUILayout.Drawn.ToArray());
        bool solved = view != null && view.HasHands && view.Weight > 0f;
        var places = bones.SelectMany(bone => new[] { bone.position.x, bone.position.y, bone.position.z });
        Console.WriteLine("{\"solved\": " + (solved ? "true" : "false") + ", \"weight\": " + (view == null ? 0f : view.Weight)
            + ", \"received\": " + (view == null ? 0 : view.Stats.Received) + ", \"drawn\": " + ControlClient.Quoted(drawn)
            + ", \"bones\": " + Numbers(places) + ", \"left\": " + Numbers(view.Hands.Left.Joints) + ", \"right\": " + Numbers(view.Hands.Right.Joints) + "}");
    }

    static string Numbers(IEnumerable<float> values)
    {
        return "[" + string.Join(",", values.Select(x => x.ToString("G9", CultureInfo.InvariantCulture)).ToArray()) + "]";
    }
}
