using System;
using System.Collections.Generic;
using System.Linq;
using System.Reflection;
using System.Threading;
using ManipNet.Client;
using ManipNet.Client.Unity;
using UnityEditor;
using UnityEngine;
using UnityEngine.XR.Hands;

/// <summary>Runs what the package offers beside posing a whole hand, with a receiver that has hands.</summary>
static class Features
{
    public static void Run(ManipNetReceiver receiver)
    {
        Partial(receiver);
        Mapped(receiver);
        Posed(receiver);
        Arm(receiver);
        Target(receiver);
        Bodies(receiver);
        Record(receiver);
        XrHands(receiver);
        Menu();
        Restart(receiver);
    }

    static ManipNetHand Hand(ManipNetReceiver receiver, Animator humanoid, Transform root, WristMode mode)
    {
        var hand = new GameObject("hand").AddComponent<ManipNetHand>();
        hand.Configure(receiver, Side.Right, humanoid, root, mode);
        return hand;
    }

    /// <summary>A hand without a little finger and without the last bone of the middle one.</summary>
    static void Partial(ManipNetReceiver receiver)
    {
        var animator = new GameObject("partial").AddComponent<Animator>();
        Glue.Skeleton(animator, "");
        Transform index = animator.Bones[HumanBodyBones.RightThumbProximal + 4];
        foreach (int missing in new[] { 8, 12, 13, 14 }) animator.Bones.Remove(HumanBodyBones.RightThumbProximal + missing);
        Glue.Call(Hand(receiver, animator, null, WristMode.Arm), "LateUpdate");
        Glue.Print("partial", Glue.Flat(index));
        var whole = new GameObject("whole").AddComponent<Animator>();
        Glue.Skeleton(whole, "");
        Glue.Call(Hand(receiver, whole, null, WristMode.Arm), "LateUpdate");
        Glue.Print("whole", Glue.Flat(whole.Bones[HumanBodyBones.RightThumbProximal + 4]));
    }

    /// <summary>A rig whose names mean nothing, with a bone map.</summary>
    static void Mapped(ManipNetReceiver receiver)
    {
        Transform rig = Glue.Skeleton(null, "RightHand");
        var lines = new List<string>();
        foreach (Transform t in rig.All().ToArray())
        {
            string odd = "x" + lines.Count;
            lines.Add("\"" + t.name + "\": \"" + odd + "\"");
            t.name = odd;
        }
        var hand = new GameObject("mapped").AddComponent<ManipNetHand>();
        hand.SetBoneMap(new TextAsset("{" + string.Join(", ", lines.ToArray()) + "}"));
        hand.Configure(receiver, Side.Right, null, rig, WristMode.Arm);
        Glue.Call(hand, "LateUpdate");
        Glue.Print("mapped", Glue.Flat(rig.All().ElementAt(5)));
        hand.SetBoneMap(new TextAsset("{\"Tail\": \"x\"}"));
    }

    /// <summary>A Humanoid that is enabled in the middle of an animation, and rests as its Avatar says.</summary>
    static void Posed(ManipNetReceiver receiver)
    {
        var animator = new GameObject("posed").AddComponent<Animator>();
        Transform hand = Glue.Skeleton(animator, "");
        int k = 0;
        var bones = new List<SkeletonBone>();
        foreach (Transform t in hand.All().Skip(1))
        {
            t.name = "bone" + k++;
            bones.Add(new SkeletonBone { name = t.name, position = t.localPosition, rotation = t.localRotation, scale = Vector3.one });
            t.localRotation = new Quaternion(0.6f, 0f, 0f, 0.8f);
        }
        animator.avatar = new Avatar { humanDescription = new HumanDescription { skeleton = bones.ToArray() } };
        Glue.Call(Hand(receiver, animator, null, WristMode.Arm), "LateUpdate");
        Glue.Print("posed", Flatten(animator.Bones[HumanBodyBones.RightThumbProximal + 4].rotation));
        var straight = new GameObject("straight").AddComponent<Animator>();
        Glue.Skeleton(straight, "");
        Glue.Call(Hand(receiver, straight, null, WristMode.Arm), "LateUpdate");
        Glue.Print("straight", Flatten(straight.Bones[HumanBodyBones.RightThumbProximal + 4].rotation));
    }

    static float[] Flatten(Quaternion q)
    {
        return new[] { q.x, q.y, q.z, q.w };
    }

    /// <summary>The hand on an arm whose shoulder is within reach of the wrist.</summary>
    static void Arm(ManipNetReceiver receiver)
    {
        Vector3 wrist = ManipNetPose.Position(receiver.Hands.Right.Wrist, 0);
        var animator = new GameObject("armed").AddComponent<Animator>();
        Transform hand = Glue.Skeleton(animator, "");
        Transform upper = new GameObject("upper").transform, lower = new GameObject("lower").transform;
        upper.position = wrist + new Vector3(0.2f, 0.3f, 0.1f);
        lower.SetParent(upper, false);
        lower.localPosition = new Vector3(0.3f, 0f, 0.02f);
        hand.SetParent(lower, false);
        hand.localPosition = new Vector3(0.28f, 0.01f, 0f);
        animator.Bones[HumanBodyBones.RightUpperArm] = upper;
        animator.Bones[HumanBodyBones.RightLowerArm] = lower;
        Glue.Call(Hand(receiver, animator, null, WristMode.Arm), "LateUpdate");
        Glue.Print("armed", new[] { hand.position.x - wrist.x, hand.position.y - wrist.y, hand.position.z - wrist.z,
            hand.localPosition.x, hand.localPosition.y, hand.localPosition.z });
    }

    static void Target(ManipNetReceiver receiver)
    {
        var animator = new GameObject("targeted").AddComponent<Animator>();
        Transform hand = Glue.Skeleton(animator, "");
        var target = new GameObject("target").transform;
        ManipNetHand fingers = Hand(receiver, animator, null, WristMode.Target);
        fingers.SetWristTarget(target);
        Glue.Call(fingers, "LateUpdate");
        Vector3 wrist = ManipNetPose.Position(receiver.Hands.Right.Wrist, 0);
        Console.WriteLine("target " + (target.position.x == wrist.x) + " " + (hand.position.x == 0f));
    }

    static void Bodies(ManipNetReceiver receiver)
    {
        var bodies = new GameObject("props").AddComponent<ManipNetBodies>();
        bodies.Configure(receiver, new Prop[0], 0.05f);
        Glue.Call(bodies, "LateUpdate");
        Glue.Call(bodies, "LateUpdate");
        Transform cube = bodies.transform.GetChild(0);
        Console.WriteLine("props " + bodies.transform.childCount + " " + cube.name + " " + cube.localScale.x.ToString("0.00"));
    }

    static void Record(ManipNetReceiver receiver)
    {
        Transform rig = Glue.Skeleton(null, "mixamorig:RightHand");
        var hand = rig.gameObject.AddComponent<ManipNetHand>();
        hand.Configure(receiver, Side.Right, null, rig, WristMode.Keep);
        var recorder = rig.gameObject.AddComponent<ManipNetRecorder>();
        recorder.Configure(receiver, rig);
        Console.WriteLine("unsaved " + (ManipNetTakes.Save(recorder) ?? "nothing"));
        recorder.Begin();
        for (int i = 0; i < 4; i++)
        {
            Glue.Call(hand, "LateUpdate");
            Glue.Call(recorder, "LateUpdate");
        }
        Console.WriteLine("recorded " + recorder.Curves.Count + " " + recorder.Curves[0].Curve.length + " " + recorder.Length.ToString("0.000"));
        Console.WriteLine("saved " + ManipNetTakes.Save(recorder));
        Console.WriteLine("curve " + AnimationUtility.Curves.Last().path + " " + AnimationUtility.Curves.Last().propertyName);
        Console.WriteLine("event " + AnimationUtility.Events.Count + " " + AnimationUtility.Events[0].stringParameter + " " + AnimationUtility.Events[0].messageOptions);
        var human = new GameObject("human");
        Glue.Skeleton(human.AddComponent<Animator>(), "");
        var muscles = human.AddComponent<ManipNetRecorder>();
        muscles.Configure(receiver, human.transform);
        muscles.Begin();
        Glue.Call(muscles, "LateUpdate");
        muscles.End();
        Console.WriteLine("muscles " + muscles.Curves.Count + " " + muscles.Curves[0].Property + "; " + muscles.Curves[39].Property
            + " " + muscles.Curves[0].Curve[0].value.ToString("0.00"));
    }

    static void XrHands(ManipNetReceiver receiver)
    {
        typeof(ManipNetHandSubsystem).GetMethod("Register", BindingFlags.NonPublic | BindingFlags.Static).Invoke(null, null);
        var runner = new GameObject("xr hands").AddComponent<ManipNetXRHands>();
        runner.Configure(receiver);
        Glue.Call(runner, "OnEnable");
        var subsystem = (ManipNetHandSubsystem)typeof(ManipNetXRHands).GetField("_subsystem", BindingFlags.NonPublic | BindingFlags.Instance).GetValue(runner);
        XRHandSubsystem.UpdateSuccessFlags done = subsystem.TryUpdateHands(XRHandSubsystem.UpdateType.Dynamic);
        Pose root = subsystem.RightRoot, index;
        subsystem.Right[7].TryGetPose(out index);
        Console.WriteLine("subsystem " + done + " " + subsystem.running + " " + subsystem.Right[7].id + " " + subsystem.Right[25].handedness);
        Glue.Print("xrroot", new[] { root.position.x, root.position.y, root.position.z, root.rotation.x, root.rotation.y, root.rotation.z, root.rotation.w });
        Glue.Call(runner, "OnDisable");
        Console.WriteLine("stopped " + !subsystem.running);
    }

    static void Menu()
    {
        ManipNetMenu.CreateHandsAndProps(null);
        GameObject made = Selection.activeGameObject;
        Console.WriteLine("menu " + made.transform.childCount + " " + (made.GetComponent<ManipNetReceiver>() != null) + " " + Undo.Recorded.Contains(made));
        ManipNetMenu.SavePrefab();
        Console.WriteLine("prefab " + AssetDatabase.Created.Last());
        Selection.activeGameObject = null;
    }

    /// <summary>Changes in the Inspector while playing: another actor, who is not there, and back.</summary>
    static void Restart(ManipNetReceiver receiver)
    {
        receiver.Actor = "nobody";
        Glue.Call(receiver, "LateUpdate");
        Thread.Sleep(300);
        Glue.Call(receiver, "LateUpdate");
        bool without = !receiver.HasHands;
        receiver.Actor = "";
        for (int i = 0; i < 1000 && !receiver.HasHands; i++)
        {
            Glue.Call(receiver, "LateUpdate");
            Thread.Sleep(10);
        }
        Console.WriteLine("restart " + without + " " + receiver.HasHands);
    }
}
