// The types of the editor and of NUnit that the package uses, complete enough to compile it.
using System;
using System.Collections.Generic;
using UnityEngine;

namespace UnityEditor
{
    public class EditorWindow : UnityEngine.Object
    {
        public static T GetWindow<T>(string title) where T : EditorWindow, new() { return new T(); }
        public void Repaint() { }
    }

    public sealed class CustomEditor : Attribute { public CustomEditor(Type inspectedType) { } }

    public class Editor : UnityEngine.Object
    {
        public UnityEngine.Object target { get; set; }
        public virtual void OnInspectorGUI() { }
        public virtual bool RequiresConstantRepaint() { return false; }
        public bool DrawDefaultInspector() { return true; }
    }

    public sealed class MenuItem : Attribute
    {
        public MenuItem(string itemName) { }
        public MenuItem(string itemName, bool isValidateFunction, int priority) { }
    }

    public sealed class MenuCommand { public UnityEngine.Object context; }

    public static class EditorApplication { public static bool isPlaying { get; set; } }

    public static class GameObjectUtility
    {
        public static void SetParentAndAlign(GameObject child, GameObject parent) { }
    }

    /// <summary>Recorded holds what was told about changes.</summary>
    public static class PrefabUtility
    {
        public static readonly List<UnityEngine.Object> Recorded = new List<UnityEngine.Object>();
        public static void RecordPrefabInstancePropertyModifications(UnityEngine.Object targetObject) { Recorded.Add(targetObject); }
        public static GameObject SaveAsPrefabAssetAndConnect(GameObject instanceRoot, string assetPath, InteractionMode action)
        {
            AssetDatabase.Created.Add(assetPath);
            return instanceRoot;
        }
    }

    public enum InteractionMode { AutomatedAction, UserAction }

    public static class AssetDatabase
    {
        public static readonly List<string> Created = new List<string>();
        public static string GenerateUniqueAssetPath(string path) { return path; }
        public static void CreateAsset(UnityEngine.Object asset, string path) { Created.Add(path); }
        public static void SaveAssets() { }
    }

    public struct EditorCurveBinding
    {
        public string path, propertyName;
        public Type type;
        public static EditorCurveBinding FloatCurve(string inPath, Type inType, string inPropertyName)
        {
            return new EditorCurveBinding { path = inPath, type = inType, propertyName = inPropertyName };
        }
    }

    public static class AnimationUtility
    {
        public static readonly List<EditorCurveBinding> Curves = new List<EditorCurveBinding>();
        public static readonly List<AnimationEvent> Events = new List<AnimationEvent>();
        public static void SetEditorCurve(AnimationClip clip, EditorCurveBinding binding, AnimationCurve curve) { Curves.Add(binding); }
        public static void SetAnimationEvents(AnimationClip clip, AnimationEvent[] events) { Events.AddRange(events); }
    }

    public enum MessageType { Info }

    public static class AssemblyReloadEvents
    {
        public static event Action beforeAssemblyReload { add { } remove { } }
    }

    /// <summary>Drawn holds the lines that were drawn, and Typed is the text that a user types.</summary>
    public static class EditorGUILayout
    {
        public static readonly List<string> Drawn = new List<string>();
        public static string Typed;
        public static string TextField(string label, string text) { return label == "Server" ? Typed ?? text : text; }
        public static float FloatField(string label, float value) { return value; }
        public static void LabelField(string label, string text) { Drawn.Add(label + ": " + text); }
        public static void HelpBox(string text, MessageType type) { Drawn.Add(text); }
        public static void Space() { }
    }

    public static class EditorGUI
    {
        public static void BeginDisabledGroup(bool disabled) { }
        public static void EndDisabledGroup() { }
    }

    public static class EditorUtility
    {
        public static bool DisplayDialog(string title, string message, string ok)
        {
            EditorGUILayout.Drawn.Add(message);
            return true;
        }
    }

    public static class Selection
    {
        public static GameObject activeGameObject { get; set; }
    }

    public static class Undo
    {
        public static readonly List<UnityEngine.Object> Recorded = new List<UnityEngine.Object>();
        public static void RecordObject(UnityEngine.Object objectToUndo, string name) { Recorded.Add(objectToUndo); }
        public static void RegisterCreatedObjectUndo(UnityEngine.Object objectToUndo, string name) { Recorded.Add(objectToUndo); }
        public static T AddComponent<T>(GameObject to) where T : Component, new() { return to.AddComponent<T>(); }
    }
}

namespace NUnit.Framework
{
    public sealed class TestAttribute : Attribute { }

    public static class StringAssert
    {
        public static void Contains(string expected, string actual)
        {
            if (!actual.Contains(expected)) throw new Exception("\"" + actual + "\" does not contain \"" + expected + "\"");
        }
    }
}
