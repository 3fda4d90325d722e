using System;
using System.Collections.Generic;

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
            var reader = new JsonReader(json ?? "");
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
                if (RigNames.IsHand(name, side) || RigNames.IsMetacarpal(name, side)) return true;
                for (int bone = 0; bone < HandRig.BoneCount; bone++)
                    if (RigNames.Matches(name, side, bone / 3, bone % 3)) return true;
            }
            return false;
        }
    }
}
