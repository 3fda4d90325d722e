"""What the Unity package assumes about Unity's API, as signatures of the public reference source.

Each was read in `UnityCsReference` (github.com/Unity-Technologies/UnityCsReference) at the tags of `VERSIONS`, where
the test looks again if `MANIPNET_UNITY_REFERENCE` names a clone of it. Spaces count as one. Those of XR Hands were read
in com.unity.xr.hands, whose source is in its package.
"""

VERSIONS = ("2021.3.58f1", "2022.3.76f1", "6000.0.78f1", "6000.3.19f1", "6000.5.2f1")

FACTS = (
    ("Modules/Animation", "public enum HumanBodyBones"),
    ("Modules/Animation", "LeftUpperArm = 13"),
    ("Modules/Animation", "RightUpperArm = 14"),
    ("Modules/Animation", "LeftLowerArm = 15"),
    ("Modules/Animation", "RightLowerArm = 16"),
    ("Modules/Animation", "LeftHand = 17"),
    ("Modules/Animation", "RightHand = 18"),
    ("Modules/Animation", "LeftThumbProximal = 24"),
    ("Modules/Animation", "RightThumbProximal = 39"),
    ("Modules/Animation", "public Transform GetBoneTransform(HumanBodyBones humanBoneId)"),
    ("Modules/Animation", "extern public bool isHuman"),
    ("Modules/Animation", "extern public Avatar avatar"),
    ("Modules/Animation", "extern public HumanDescription humanDescription"),
    ("Modules/Animation", "public struct SkeletonBone"),
    ("Modules/Animation", "public SkeletonBone[] skeleton"),
    ("Modules/Animation", "public class HumanPoseHandler : IDisposable"),
    ("Modules/Animation", "public HumanPoseHandler(Avatar avatar, Transform root)"),
    ("Modules/Animation", "public void GetHumanPose(ref HumanPose humanPose)"),
    ("Modules/Animation", "public float[] muscles"),
    ("Modules/Animation", "extern public static string[] MuscleName"),
    ("Modules/Animation", "public string functionName"),
    ("Modules/Animation", "public string stringParameter"),
    ("Modules/Animation", "public float floatParameter"),
    ("Modules/Animation", "public SendMessageOptions messageOptions"),
    ("Modules/Animation", "public extern float frameRate"),
    ("Runtime/Export", "public int AddKey(float time, float value)"),
    ("Runtime/Export", "public Keyframe this[int index]"),
    ("Runtime/Export", "partial struct Pose : IEquatable<Pose>"),
    ("Runtime/Export", "public Pose(Vector3 position, Quaternion rotation)"),
    ("Runtime/Export", "SubsystemRegistration"),
    ("Runtime/Export", "public static Vector3 Scale(Vector3 a, Vector3 b)"),
    ("Runtime/Export", "public extern static GameObject CreatePrimitive(PrimitiveType type);"),
    ("Runtime/Export", "public class PreserveAttribute"),
    ("Modules/Subsystems", "public static void GetSubsystemDescriptors<T>(List<T> descriptors)"),
    ("Modules/TextRendering|Runtime/Export", "public string text"),
    ("Editor/Mono", "public MenuItem(string itemName, bool isValidateFunction, int priority)"),
    ("Editor/Mono", "void RecordObject(Object objectToUndo, string name)"),
    ("Editor/Mono", "public static void RegisterCreatedObjectUndo(Object objectToUndo, string name)"),
    ("Editor/Mono", "public static T AddComponent<T>(GameObject gameObject) where T : Component"),
    ("Editor/Mono", "public static void RecordPrefabInstancePropertyModifications"),
    ("Editor/Mono", "static GameObject SaveAsPrefabAssetAndConnect(GameObject instanceRoot, string assetPath"),
    (
        "Editor/Mono",
        "static public EditorCurveBinding FloatCurve(string inPath, System.Type inType",
    ),
    (
        "Editor/Mono",
        "public static void SetEditorCurve(AnimationClip clip, EditorCurveBinding binding",
    ),
    ("Editor/Mono", "public static void SetAnimationEvents"),
    ("Editor/Mono", "public bool DrawDefaultInspector()"),
    ("Editor/Mono", "public virtual bool RequiresConstantRepaint()"),
    ("Editor/Mono", "public CustomEditor(System.Type inspectedType)"),
    ("Runtime/Transform|Runtime/Export", "public extern Vector3 lossyScale"),
    ("Editor/Mono", "public static void SetParentAndAlign(GameObject child, GameObject parent)"),
    ("Modules/AssetDatabase|Editor/Mono", "extern public static string GenerateUniqueAssetPath(string path);"),
    ("Modules/AssetDatabase|Editor/Mono", "CreateAsset([NotNull] Object asset, string path)"),
)
