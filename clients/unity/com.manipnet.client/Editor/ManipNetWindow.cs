using UnityEditor;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Tests a connection without play mode, shows the state of all receivers, sets up a character, and records takes.
    /// </summary>
    public sealed class ManipNetWindow : EditorWindow
    {
        string _address = "tcp://127.0.0.1:5555";
        ManipNetClient _client;

        [MenuItem("Window/ManipNet")]
        static void Open()
        {
            GetWindow<ManipNetWindow>("ManipNet");
        }

        void OnEnable()
        {
            AssemblyReloadEvents.beforeAssemblyReload += Stop;
        }

        void OnDisable()
        {
            AssemblyReloadEvents.beforeAssemblyReload -= Stop;
            Stop();
        }

        void OnInspectorUpdate()
        {
            Repaint();
        }

        void OnGUI()
        {
            _address = EditorGUILayout.TextField("Server", _address);
            if (_client == null && GUILayout.Button("Test connection")) Connect();
            else if (_client != null && GUILayout.Button("Stop test")) Stop();
            if (_client != null) ManipNetInspectors.Show(_client.GetStats());
            foreach (ManipNetReceiver receiver in Resources.FindObjectsOfTypeAll<ManipNetReceiver>())
            {
                EditorGUILayout.Space();
                EditorGUILayout.LabelField(receiver.name, receiver.Address);
                ManipNetInspectors.Show(receiver);
            }
            foreach (ManipNetControl control in Resources.FindObjectsOfTypeAll<ManipNetControl>())
            {
                EditorGUILayout.Space();
                EditorGUILayout.LabelField("Server of " + control.name, control.Address);
                ManipNetInspectors.Show(control);
            }
            if (EditorApplication.isPlaying)
                foreach (ManipNetRecorder recorder in Resources.FindObjectsOfTypeAll<ManipNetRecorder>()) Record(recorder);
            EditorGUILayout.Space();
            Animator selected = Selection.activeGameObject == null ? null : Selection.activeGameObject.GetComponent<Animator>();
            EditorGUI.BeginDisabledGroup(selected == null);
            if (GUILayout.Button("Add hands to the selected character")) SetUp(selected);
            EditorGUI.EndDisabledGroup();
            if (selected == null) EditorGUILayout.HelpBox("Select an object that has an Animator.", MessageType.Info);
        }

        void Connect()
        {
            try
            {
                _client = new ManipNetClient(_address);
            }
            catch (System.ArgumentException error)
            {
                EditorUtility.DisplayDialog("ManipNet", error.Message, "OK");
            }
        }

        void Stop()
        {
            if (_client != null) _client.Dispose();
            _client = null;
        }

        void SetUp(Animator character)
        {
            GameObject on = character.gameObject;
            ManipNetReceiver receiver = on.GetComponent<ManipNetReceiver>();
            if (receiver == null) receiver = Undo.AddComponent<ManipNetReceiver>(on);
            Change(receiver, () => receiver.Address = _address);
            foreach (Side side in new[] { Side.Left, Side.Right })
            {
                ManipNetHand hand = HandOf(on, side);
                if (hand != null) continue; // it keeps its settings
                hand = Undo.AddComponent<ManipNetHand>(on);
                Change(hand, () => hand.Configure(receiver, side, character, null, WristMode.Keep));
            }
            ManipNetRecorder recorder = on.GetComponent<ManipNetRecorder>();
            if (recorder != null) return;
            recorder = Undo.AddComponent<ManipNetRecorder>(on);
            Change(recorder, () => recorder.Configure(receiver, on.transform));
        }

        static ManipNetHand HandOf(GameObject on, Side side)
        {
            foreach (ManipNetHand hand in on.GetComponents<ManipNetHand>())
                if (hand.Side == side) return hand;
            return null;
        }

        /// <summary>Changes a component so that Undo takes it back and an instance of a prefab keeps it.</summary>
        static void Change(Component component, System.Action change)
        {
            Undo.RecordObject(component, "Set up ManipNet hands");
            change();
            PrefabUtility.RecordPrefabInstancePropertyModifications(component);
        }

        static void Record(ManipNetRecorder recorder)
        {
            if (!recorder.IsRecording)
            {
                if (GUILayout.Button("Record " + recorder.name)) recorder.Begin();
                return;
            }
            EditorGUILayout.LabelField("Recording", recorder.Length.ToString("0.0") + " s");
            if (!GUILayout.Button("Stop and save " + recorder.name)) return;
            string path = ManipNetTakes.Save(recorder);
            EditorUtility.DisplayDialog("ManipNet", path == null ? "Nothing was recorded: no hands have arrived." : "The take is " + path + ".", "OK");
        }
    }
}
