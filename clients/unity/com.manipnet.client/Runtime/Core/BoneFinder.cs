using System;
using System.Collections.Generic;

namespace ManipNet.Client
{
    /// <summary>The bones of one hand, as indices of a list of names; -1 for a bone that is not in it.</summary>
    public sealed class BoneIndices
    {
        public int Hand = -1;

        /// <summary>15 finger bones, thumb to little finger, proximal to distal.</summary>
        public readonly int[] Fingers = new int[HandRig.BoneCount];

        /// <summary>The bones in the palm, by finger; the thumb has none.</summary>
        public readonly int[] Metacarpals = new int[HandRig.FingerCount];

        public BoneIndices()
        {
            for (int i = 0; i < Fingers.Length; i++) Fingers[i] = -1;
            for (int i = 0; i < Metacarpals.Length; i++) Metacarpals[i] = -1;
        }

        public bool AnyFinger
        {
            get { return Array.Exists(Fingers, bone => bone >= 0); }
        }
    }

    /// <summary>
    /// Finds the bones of a hand among all bones of a rig. The list decides what one name cannot: whether a thumb is counted
    /// from its metacarpal or from zero, and which prefix all names share, as Motive's have.
    /// </summary>
    public static class BoneFinder
    {
        public static BoneIndices Find(IList<string> names, Side side)
        {
            var byName = new Dictionary<string, int>();
            Add(names, "", byName);
            BoneIndices found = Lookup(byName, side);
            if (found.AnyFinger || Lookup(byName, side == Side.Left ? Side.Right : Side.Left).AnyFinger) return found;
            Add(names, Prefix(names), byName);
            return Lookup(byName, side);
        }

        /// <summary>Adds the plain names without the prefix; of two equal ones the first counts.</summary>
        static void Add(IList<string> names, string prefix, Dictionary<string, int> byName)
        {
            for (int i = 0; i < names.Count; i++)
            {
                bool begins = names[i].StartsWith(prefix, StringComparison.Ordinal);
                string plain = RigNames.Plain(begins ? names[i].Substring(prefix.Length) : names[i]);
                if (!byName.ContainsKey(plain)) byName.Add(plain, i);
            }
        }

        static BoneIndices Lookup(Dictionary<string, int> byName, Side side)
        {
            bool left = side == Side.Left;
            var found = new BoneIndices { Hand = First(byName, (left ? RigNameTable.LeftHandBones : RigNameTable.RightHandBones)[0]) };
            string[] fingers = left ? RigNameTable.LeftFingerBones : RigNameTable.RightFingerBones;
            for (int bone = 0; bone < fingers.Length; bone++) found.Fingers[bone] = First(byName, fingers[bone]);
            CountThumb(byName, side, found);
            string[] metacarpals = left ? RigNameTable.LeftMetacarpals : RigNameTable.RightMetacarpals;
            for (int i = 0; i < metacarpals.Length; i++) found.Metacarpals[1 + i] = First(byName, metacarpals[i]);
            return found;
        }

        /// <summary>VRM 1 and Godot count the thumb from its metacarpal, and VRChat counts it from zero.</summary>
        static void CountThumb(Dictionary<string, int> byName, Side side, BoneIndices found)
        {
            bool left = side == Side.Left;
            int metacarpal = First(byName, (left ? RigNameTable.LeftThumbMetacarpals : RigNameTable.RightThumbMetacarpals)[0]);
            string end = left ? "l" : "r";
            if (metacarpal >= 0 && found.Fingers[0] >= 0)
            {
                found.Fingers[1] = found.Fingers[0];
                found.Fingers[0] = metacarpal;
            }
            else if (byName.ContainsKey("thumb0" + end))
            {
                for (int part = 0; part < 3; part++)
                {
                    int bone = First(byName, "thumb" + part + end);
                    if (bone >= 0) found.Fingers[part] = bone;
                }
            }
        }

        /// <summary>The first of the candidates, which a space separates, that the rig has.</summary>
        static int First(Dictionary<string, int> byName, string candidates)
        {
            int bone;
            foreach (string name in candidates.Split(' '))
                if (byName.TryGetValue(name, out bone)) return bone;
            return -1;
        }

        /// <summary>What all names begin with, up to a punctuation mark, such as the name of the skeleton in Motive.</summary>
        static string Prefix(IList<string> names)
        {
            var sorted = new List<string>();
            foreach (string name in names)
                if (RigNames.Plain(name).Contains("hand")) sorted.Add(name);
            if (sorted.Count == 0) sorted.AddRange(names);
            if (sorted.Count == 0) return "";
            sorted.Sort(StringComparer.Ordinal);
            string first = sorted[0], last = sorted[sorted.Count - 1];
            int same = 0;
            while (same < first.Length && same < last.Length && first[same] == last[same]) same++;
            return first.Substring(0, first.Substring(0, same).LastIndexOfAny(new[] { '_', ':', '-', '.' }) + 1);
        }
    }
}
