using System;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>The names of finger bones in common rigs.</summary>
    public static class RigNames
    {
        static readonly string[][] Words =
        {
            new[] { "thumb" }, new[] { "index" }, new[] { "middle", "mid" }, new[] { "ring" }, new[] { "little", "pinky" }
        };

        /// <summary>
        /// Whether the name `bone` means this bone of this finger, both counted from zero. It knows the names in
        /// clients/README.md. Rigs of VRM 1 and Godot have a `thumbMetacarpal` (IsThumbMetacarpal), and call the second
        /// bone of the thumb proximal.
        /// </summary>
        public static bool Matches(string bone, Side side, int finger, int part, bool thumbMetacarpal = false)
        {
            string name = Plain(bone), s = Word(side), l = s.Substring(0, 1), n = (part + 1).ToString();
            bool counted = bone.Length == 8 && (bone.EndsWith("_L", StringComparison.Ordinal) || bone.EndsWith("_R", StringComparison.Ordinal));
            if (finger == 0 && counted && bone.StartsWith("Thumb", StringComparison.Ordinal))  // VRChat counts the thumb from zero
                return char.ToLowerInvariant(bone[7]) == l[0] && bone[5] - '0' == part;
            if (IsThumbMetacarpal(bone, side)) return finger == 0 && part == 0;
            if (finger == 0 && thumbMetacarpal && part < 2) return part == 1 && IsPart(name, s, "thumb", HandRig.Parts[0]);
            if (name == "bip01" + l + "finger" + finger + (part == 0 ? "" : part.ToString())) return true;
            if (name == "finger" + (finger + 1) + n + l) return true;
            foreach (string word in Words[finger])
                if (IsPart(name, s, word, HandRig.Parts[part]) || IsCounted(name, s, l, word, n)) return true;
            return false;
        }

        /// <summary>Whether the name `bone` means the first bone of a thumb, as in VRM 1 and Godot.</summary>
        public static bool IsThumbMetacarpal(string bone, Side side)
        {
            return Plain(bone) == Word(side) + "thumbmetacarpal";
        }

        /// <summary>Whether the name `bone` means the hand itself.</summary>
        public static bool IsHand(string bone, Side side)
        {
            string name = Plain(bone), s = Word(side), l = s.Substring(0, 1);
            return name == s + "hand" || name == "mixamorig" + s + "hand" || name == s + "wrist" || name == "wrist" + l
                || name == "chandfk" + l || name == "hand" + l || name == "defhand" + l || name == l + "hand"
                || name == "jbip" + l + "hand" || name == "ccbase" + l + "hand" || name == "bip01" + l + "hand";
        }

        static string Word(Side side)
        {
            return side == Side.Left ? "left" : "right";
        }

        static bool IsPart(string name, string side, string word, string part)
        {
            part = part.ToLowerInvariant();
            return name == side + word + part || name == word + part + side.Substring(0, 1);
        }

        static bool IsCounted(string name, string side, string letter, string word, string number)
        {
            string before = letter + word + number, after = word + number + letter, zero = word + "0" + number + letter;
            return name == side + "hand" + word + number || name == "mixamorig" + side + "hand" + word + number
                || name == zero || name == "f" + zero || name == "def" + zero || name == "deff" + zero
                || name == before || name == "jbip" + before || name == "ccbase" + before
                || name == after || name == "c" + after
                || name == side + word + number || name == word + "finger" + number + letter;
        }

        /// <summary>The name in lower case, without its namespace and punctuation.</summary>
        static string Plain(string name)
        {
            var plain = new StringBuilder();
            foreach (char c in name.Substring(name.LastIndexOf(':') + 1))
                if (char.IsLetterOrDigit(c)) plain.Append(char.ToLowerInvariant(c));
            return plain.ToString();
        }
    }
}
