using UnityEditor;
using UnityEngine;

namespace ManipNet.Client.Unity
{
    /// <summary>Saves what a ManipNetRecorder recorded as an AnimationClip in the project.</summary>
    public static class ManipNetTakes
    {
        /// <summary>The clip's frames per second, those of the stream.</summary>
        public const float FrameRate = Layout.RateHz;

        /// <summary>Ends the take and saves it under Assets. Returns the path, or null if nothing was recorded.</summary>
        public static string Save(ManipNetRecorder recorder)
        {
            recorder.End();
            if (recorder.Curves.Count == 0 || recorder.Curves[0].Curve.length == 0) return null;
            var clip = new AnimationClip { frameRate = FrameRate };
            foreach (RecordedCurve recorded in recorder.Curves)
                AnimationUtility.SetEditorCurve(clip, EditorCurveBinding.FloatCurve(recorded.Path, recorded.Type, recorded.Property), recorded.Curve);
            AnimationUtility.SetAnimationEvents(clip, recorder.Events);
            string timecode = recorder.FirstTimecode == null ? "" : " " + recorder.FirstTimecode.Replace(':', '.').Replace(';', '.');
            string path = AssetDatabase.GenerateUniqueAssetPath("Assets/ManipNet take" + timecode + ".anim");
            AssetDatabase.CreateAsset(clip, path);
            AssetDatabase.SaveAssets();
            return path;
        }
    }
}
