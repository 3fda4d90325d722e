using UnityEditor;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>What the window and the Inspector show of receivers and of the server's remote control.</summary>
    public static class ManipNetInspectors
    {
        /// <summary>Shows every stream of a receiver, and whether the server solves on its avatars.</summary>
        public static void Show(ManipNetReceiver receiver)
        {
            bool any = false;
            foreach (HandsView view in receiver.Views)
            {
                any = true;
                EditorGUILayout.LabelField("Stream", view.Name == "" ? "first actor" : view.Name);
                Show(view.Stats);
            }
            if (!any) EditorGUILayout.LabelField("State", receiver.Stats.State);
        }

        public static void Show(Stats stats)
        {
            EditorGUILayout.LabelField("State", stats.State);
            EditorGUILayout.LabelField("Rate", stats.RateHz.ToString("0.0") + " Hz");
            EditorGUILayout.LabelField("Age", stats.Received == 0 ? "no message yet" : (1000.0 * stats.AgeS).ToString("0") + " ms");
            EditorGUILayout.LabelField("Lost, late, refused", stats.Lost + ", " + stats.Late + ", " + stats.Refused);
            if (stats.Received == 0)
                EditorGUILayout.HelpBox("Nothing has arrived. Check that the server is running and that this is the address in its line `ready`.", MessageType.Info);
        }

        /// <summary>Buttons for recording, pause and objects of the server, and its newest reply.</summary>
        public static void Show(ManipNetControl control)
        {
            control.Take = EditorGUILayout.TextField("Take", control.Take);
            if (GUILayout.Button("Record on the server")) control.Record();
            if (GUILayout.Button("Stop recording on the server")) control.StopRecording();
            if (GUILayout.Button("Pause the server")) control.Pause(true);
            if (GUILayout.Button("Continue")) control.Pause(false);
            control.Body = EditorGUILayout.TextField("Body", control.Body);
            control.Shape = EditorGUILayout.TextField("Object", control.Shape);
            control.ShapeScale = EditorGUILayout.FloatField("Scale", control.ShapeScale);
            if (GUILayout.Button("Give the body this object")) control.SelectObject();
            if (GUILayout.Button("Which objects are there?")) control.Send("objects");
            EditorGUILayout.HelpBox(control.IsBusy ? "waiting for the server" : control.LastReply, MessageType.Info);
        }
    }

    /// <summary>Adds the state of the streams to the Inspector of a receiver.</summary>
    [CustomEditor(typeof(ManipNetReceiver))]
    public sealed class ManipNetReceiverEditor : Editor
    {
        public override void OnInspectorGUI()
        {
            DrawDefaultInspector();
            if (EditorApplication.isPlaying) ManipNetInspectors.Show((ManipNetReceiver)target);
        }

        public override bool RequiresConstantRepaint()
        {
            return EditorApplication.isPlaying;
        }
    }

    /// <summary>Adds the remote control of the server to the Inspector of a ManipNetControl.</summary>
    [CustomEditor(typeof(ManipNetControl))]
    public sealed class ManipNetControlEditor : Editor
    {
        public override void OnInspectorGUI()
        {
            DrawDefaultInspector();
            ManipNetInspectors.Show((ManipNetControl)target);
        }

        public override bool RequiresConstantRepaint()
        {
            return ((ManipNetControl)target).IsBusy;
        }
    }
}
