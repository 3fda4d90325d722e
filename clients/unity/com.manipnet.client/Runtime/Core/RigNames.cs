using System;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>The names of finger bones in common rigs.</summary>
    public static class RigNames
    {
        /// <summary>
        /// Whether the name `bone` means this bone of this finger, both counted from zero. It knows the names of Unity
        /// and VMC (LeftIndexProximal), Mixamo (mixamorig:LeftHandIndex1), Unreal (index_01_l), Rigify (f_index.01.L)
        /// and VRoid (J_Bip_L_Index1).
        /// </summary>
        public static bool Matches(string bone, Side side, int finger, int part)
        {
            string name = Plain(bone);
            string s = side == Side.Left ? "left" : "right", l = side == Side.Left ? "l" : "r";
            string f = HandRig.Fingers[finger].ToLowerInvariant(), n = (part + 1).ToString();
            if (Is(name, s, f, HandRig.Parts[part].ToLowerInvariant(), "")) return true;
            if (Matches(name, s, l, f, n)) return true;
            return f == "little" && Matches(name, s, l, "pinky", n);
        }

        /// <summary>Whether the name `bone` means the hand itself.</summary>
        public static bool IsHand(string bone, Side side)
        {
            string name = Plain(bone), s = side == Side.Left ? "left" : "right", l = side == Side.Left ? "l" : "r";
            return name == s + "hand" || name == "hand" + l || name == "jbip" + l + "hand" || name == "defhand" + l;
        }

        static bool Matches(string name, string side, string letter, string finger, string number)
        {
            return Is(name, side, "hand", finger, number)
                || Is(name, finger, "0", number, letter)
                || Is(name, "f", finger, "0" + number, letter)
                || Is(name, "jbip", letter, finger, number);
        }

        static bool Is(string name, string a, string b, string c, string d)
        {
            return name == a + b + c + d;
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
