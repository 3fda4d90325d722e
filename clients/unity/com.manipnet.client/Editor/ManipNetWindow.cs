using UnityEditor;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>
    /// Tests a connection without play mode, shows the state of all receivers, and sets up a character.
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
            if (_client != null) Show(_client.GetStats());
            foreach (ManipNetReceiver receiver in Resources.FindObjectsOfTypeAll<ManipNetReceiver>())
            {
                EditorGUILayout.Space();
                EditorGUILayout.LabelField(receiver.name, receiver.Address);
                Show(receiver.Stats);
            }
            EditorGUILayout.Space();
            Animator selected = Selection.activeGameObject == null ? null : Selection.activeGameObject.GetComponent<Animator>();
            EditorGUI.BeginDisabledGroup(selected == null);
            if (GUILayout.Button("Add hands to the selected character")) SetUp(selected);
            EditorGUI.EndDisabledGroup();
            if (selected == null) EditorGUILayout.HelpBox("Select an object that has an Animator.", MessageType.Info);
        }

        static void Show(Stats stats)
        {
            EditorGUILayout.LabelField("State", stats.State);
            EditorGUILayout.LabelField("Rate", stats.RateHz.ToString("0.0") + " Hz");
            EditorGUILayout.LabelField("Age", stats.Received == 0 ? "no message yet" : (1000.0 * stats.AgeS).ToString("0") + " ms");
            EditorGUILayout.LabelField("Lost, late, refused", stats.Lost + ", " + stats.Late + ", " + stats.Refused);
            if (stats.Received == 0)
                EditorGUILayout.HelpBox("Nothing has arrived. Check that the server is running and that this is the address in its line `ready`.", MessageType.Info);
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
            receiver.Address = _address;
            foreach (Side side in new[] { Side.Left, Side.Right })
                Undo.AddComponent<ManipNetHand>(on).Configure(receiver, side, character, null, false);
        }
    }
}
