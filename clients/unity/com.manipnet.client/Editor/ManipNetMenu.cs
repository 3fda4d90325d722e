using UnityEditor;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>Makes objects with the components set up, in the menu GameObject > ManipNet.</summary>
    public static class ManipNetMenu
    {
        const float SphereDiameter = 0.012f, CubeEdge = 0.05f;

        /// <summary>Makes a receiver, both hands as spheres at their joints, and a cube for every tracked body.</summary>
        [MenuItem("GameObject/ManipNet/Hands and Props", false, 10)]
        public static void CreateHandsAndProps(MenuCommand command)
        {
            var made = new GameObject("ManipNet");
            GameObjectUtility.SetParentAndAlign(made, command == null ? null : command.context as GameObject);
            var receiver = made.AddComponent<ManipNetReceiver>();
            foreach (Side side in new[] { Side.Left, Side.Right })
                Child(made, side + " hand").AddComponent<ManipNetJoints>().Configure(receiver, side, null, SphereDiameter);
            Child(made, "Props").AddComponent<ManipNetBodies>().Configure(receiver, new Prop[0], CubeEdge);
            Undo.RegisterCreatedObjectUndo(made, "Create ManipNet hands");
            Selection.activeGameObject = made;
        }

        /// <summary>Saves the selected object as a prefab beside the project's other assets.</summary>
        [MenuItem("GameObject/ManipNet/Save as Prefab", false, 11)]
        public static void SavePrefab()
        {
            GameObject selected = Selection.activeGameObject;
            if (selected == null || selected.GetComponent<ManipNetReceiver>() == null)
            {
                EditorUtility.DisplayDialog("ManipNet", "Select an object that has a ManipNet Receiver.", "OK");
                return;
            }
            string path = AssetDatabase.GenerateUniqueAssetPath("Assets/" + selected.name + ".prefab");
            PrefabUtility.SaveAsPrefabAssetAndConnect(selected, path, InteractionMode.UserAction);
        }

        static GameObject Child(GameObject parent, string name)
        {
            var child = new GameObject(name);
            child.transform.SetParent(parent.transform, false);
            return child;
        }
    }
}
