using System;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>The names of finger bones in common rigs.</summary>
    public static class RigNames
    {
        /// <summary>
        /// Whether the name `bone` means this bone of this finger, both counted from zero. It knows the names in
        /// clients/README.md. Rigs of VRM 1 and Godot have a `thumbMetacarpal` (IsThumbMetacarpal), and call the second
        /// bone of the thumb proximal.
        /// </summary>
        public static bool Matches(string bone, Side side, int finger, int part, bool thumbMetacarpal = false)
        {
            string name = Plain(bone), s = Word(side), l = s.Substring(0, 1);
            bool counted = bone.Length == 8 && (bone.EndsWith("_L", StringComparison.Ordinal) || bone.EndsWith("_R", StringComparison.Ordinal));
            if (finger == 0 && counted && bone.StartsWith("Thumb", StringComparison.Ordinal))  // VRChat counts the thumb from zero
                return char.ToLowerInvariant(bone[7]) == l[0] && bone[5] - '0' == part;
            if (IsThumbMetacarpal(bone, side)) return finger == 0 && part == 0;
            if (finger == 0 && thumbMetacarpal && part < 2) return part == 1 && (name == s + "thumbproximal" || name == "thumbproximal" + l);
            return Has(side == Side.Left ? RigNameTable.LeftFingerBones : RigNameTable.RightFingerBones, 3 * finger + part, name);
        }

        /// <summary>Whether the name `bone` means the first bone of a thumb, as in VRM 1 and Godot.</summary>
        public static bool IsThumbMetacarpal(string bone, Side side)
        {
            return Has(side == Side.Left ? RigNameTable.LeftThumbMetacarpals : RigNameTable.RightThumbMetacarpals, 0, Plain(bone));
        }

        /// <summary>Whether the name `bone` means the hand itself.</summary>
        public static bool IsHand(string bone, Side side)
        {
            return Has(side == Side.Left ? RigNameTable.LeftHandBones : RigNameTable.RightHandBones, 0, Plain(bone));
        }

        /// <summary>Whether the name `bone` means a bone in the palm that leads to one of the four fingers.</summary>
        public static bool IsMetacarpal(string bone, Side side)
        {
            string[] rows = side == Side.Left ? RigNameTable.LeftMetacarpals : RigNameTable.RightMetacarpals;
            for (int row = 0; row < rows.Length; row++)
                if (Has(rows, row, Plain(bone))) return true;
            return false;
        }

        static string Word(Side side)
        {
            return side == Side.Left ? "left" : "right";
        }

        static bool Has(string[] rows, int row, string name)
        {
            return (" " + rows[row] + " ").Contains(" " + name + " ");
        }

        /// <summary>The name in lower case, without its namespace and punctuation.</summary>
        public static string Plain(string name)
        {
            var plain = new StringBuilder();
            foreach (char c in name.Substring(name.LastIndexOf(':') + 1).Normalize(NormalizationForm.FormKC))
                if (char.IsLetterOrDigit(c)) plain.Append(char.ToLowerInvariant(c));
            return plain.ToString();
        }
    }
}
