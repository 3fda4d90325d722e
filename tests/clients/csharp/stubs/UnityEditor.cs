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

    public sealed class MenuItem : Attribute { public MenuItem(string path) { } }

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
        public static string TextField(string label, string text) { return Typed ?? text; }
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
