using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;

namespace ManipNet.Client
{
    /// <summary>
    /// A map of bones that was made by hand, in JSON: {"LeftHandIndex1": "a bone of the rig", ...}. Its keys are names of
    /// any scheme that RigNames knows. The format is the same in all clients.
    /// </summary>
    public sealed class BoneMap
    {
        readonly Dictionary<string, string> _known = new Dictionary<string, string>();

        /// <summary>The name by which a bone of the rig is looked up: its own, or the one that the map gives it.</summary>
        public string NameOf(string bone)
        {
            string known;
            return _known.TryGetValue(bone, out known) ? known : bone;
        }

        /// <summary>The bones of the rig that the map names.</summary>
        public ICollection<string> Bones
        {
            get { return _known.Keys; }
        }

        /// <summary>Whether the map names this bone of the rig.</summary>
        public bool Has(string bone)
        {
            return _known.ContainsKey(bone);
        }

        /// <summary>Reads a map; throws ArgumentException that says what is wrong and what is allowed.</summary>
        public static BoneMap Parse(string json)
        {
            var map = new BoneMap();
            var reader = new Reader(json ?? "");
            if (reader.AtEnd) return map;
            bool good = reader.Take('{'), more = good && !reader.Take('}');
            while (more && good)
            {
                string meaning = reader.TakeText(), bone = reader.Take(':') ? reader.TakeText() : null;
                good = meaning != null && bone != null;
                if (!good) break;
                if (!IsKnown(meaning))
                    throw new ArgumentException("the bone map names \"" + meaning + "\"; allowed are names like LeftHand, LeftHandIndex1 or RightThumbProximal");
                map._known[bone] = meaning;
                more = reader.Take(',');
                good = more || reader.Take('}');
            }
            if (!good || !reader.AtEnd)
                throw new ArgumentException("the bone map is not JSON at character " + (reader.Position + 1) + "; allowed is {\"LeftHandIndex1\": \"a bone of the rig\", ...}");
            return map;
        }

        static bool IsKnown(string name)
        {
            foreach (Side side in new[] { Side.Left, Side.Right })
            {
                if (RigNames.IsHand(name, side)) return true;
                for (int bone = 0; bone < HandRig.BoneCount; bone++)
                    if (RigNames.Matches(name, side, bone / 3, bone % 3)) return true;
            }
            return false;
        }

        /// <summary>Reads the little JSON that a bone map has: one object of texts.</summary>
        sealed class Reader
        {
            readonly string _text;

            public Reader(string text)
            {
                _text = text;
            }

            public int Position { get; private set; }

            public bool AtEnd
            {
                get
                {
                    while (Position < _text.Length && char.IsWhiteSpace(_text[Position])) Position++;
                    return Position >= _text.Length;
                }
            }

            /// <summary>Skips spaces and takes `wanted` if it comes next.</summary>
            public bool Take(char wanted)
            {
                if (AtEnd || _text[Position] != wanted) return false;
                Position++;
                return true;
            }

            /// <summary>Takes a text, or returns null if none comes next.</summary>
            public string TakeText()
            {
                if (!Take('"')) return null;
                var value = new StringBuilder();
                while (Position < _text.Length && _text[Position] != '"')
                    if (!TakeCharacter(value)) return null;
                return Position++ < _text.Length && IsWhole(value.ToString()) ? value.ToString() : null;
            }

            /// <summary>Whether no character beyond 16 bits is cut in half, as by a wrong escape.</summary>
            static bool IsWhole(string text)
            {
                for (int i = 0; i < text.Length; i++)
                {
                    if (!char.IsSurrogate(text[i])) continue;
                    if (i + 1 >= text.Length || !char.IsSurrogatePair(text[i], text[i + 1])) return false;
                    i++;
                }
                return true;
            }

            bool TakeCharacter(StringBuilder value)
            {
                char c = _text[Position++];
                if (c != '\\')
                {
                    value.Append(c);
                    return true;
                }
                char kind = Position < _text.Length ? _text[Position++] : '\0';
                if (kind != 'u')
                {
                    value.Append(kind);
                    return kind == '"' || kind == '\\' || kind == '/';
                }
                int code = 0;
                if (Position + 4 > _text.Length
                    || !int.TryParse(_text.Substring(Position, 4), NumberStyles.AllowHexSpecifier, CultureInfo.InvariantCulture, out code)) return false;
                value.Append((char)code);
                Position += 4;
                return true;
            }
        }
    }
}
