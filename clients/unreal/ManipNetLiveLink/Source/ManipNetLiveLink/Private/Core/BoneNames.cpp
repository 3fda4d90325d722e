#include "BoneNames.h"

#include "RigNames.h"

namespace manipnet {
namespace {

bool IsAlphanumeric(char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || static_cast<unsigned char>(c) >= 0x80;
}

char Lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

/// The ASCII character that stands for a full-width one of Japanese rigs (U+FF01 to U+FF5E) at `at`, or 0 if none does.
char HalfWidth(const std::string& name, std::size_t at) {
    if (name.compare(at, 2, "\xEF\xBC") != 0 && name.compare(at, 2, "\xEF\xBD") != 0) return 0;
    if (at + 2 >= name.size()) return 0;
    const int code = (static_cast<unsigned char>(name[at + 1]) - 0xBC) * 64 + static_cast<unsigned char>(name[at + 2]) - 0x81;
    return code >= 0 && code < 0x5E ? static_cast<char>(0x21 + code) : static_cast<char>(0);
}

/// The name in lower case, without its namespace and punctuation.
std::string Plain(const std::string& name) {
    std::string plain;
    for (std::size_t i = name.rfind(':') + 1; i < name.size(); ++i) {
        const char narrow = HalfWidth(name, i);
        const char c = narrow != 0 ? narrow : name[i];
        if (IsAlphanumeric(c)) plain += Lower(c);
        if (narrow != 0) i += 2;
    }
    return plain;
}

bool IsTwist(const std::string& name) { return Plain(name).find("twist") != std::string::npos; }

/// VRChat counts the bones of the thumb from zero, as in "Thumb0_L".
bool IsVrchatThumb(const std::string& bone) {
    return bone.size() == 8 && bone.compare(0, 5, "Thumb") == 0 && bone[6] == '_' && (bone[7] == 'L' || bone[7] == 'R');
}

/// The parent of a bone, beyond bones that only spread a twist.
int ArmAbove(const std::vector<std::string>& names, const std::vector<int>& parents, int bone) {
    int above = bone < 0 ? -1 : parents[static_cast<std::size_t>(bone)];
    while (above >= 0 && IsTwist(names[static_cast<std::size_t>(above)])) above = parents[static_cast<std::size_t>(above)];
    return above;
}

/// The name by which a bone is looked up: its own, or the one that the map gives it.
std::vector<std::string> Renamed(const std::vector<std::string>& names, const BoneMap& map) {
    std::vector<std::string> known = names;
    for (const auto& [meaning, bone] : map)
        for (std::size_t i = 0; i < names.size(); ++i)
            if (names[i] == bone) known[i] = meaning;
    return known;
}

template <std::size_t N>
bool IsOneOf(const rig_names::Hand (&table)[N], const std::string& bone, Side side) {
    const std::string plain = Plain(bone);
    for (const rig_names::Hand& known : table)
        if (known.Side == static_cast<int>(side) && plain == known.Name) return true;
    return false;
}

}  // namespace

bool IsThumbMetacarpal(const std::string& bone, Side side) { return IsOneOf(rig_names::kThumbMetacarpals, bone, side); }

bool IsHandName(const std::string& bone, Side side) { return IsOneOf(rig_names::kHands, bone, side); }

bool MatchesFinger(const std::string& bone, Side side, std::size_t finger, std::size_t part, bool thumbMetacarpal) {
    if (finger == 0 && IsVrchatThumb(bone))
        return bone[7] == (side == Side::Left ? 'L' : 'R') && bone[5] == static_cast<char>('0' + part);
    if (IsThumbMetacarpal(bone, side)) return finger == 0 && part == 0;
    const std::string plain = Plain(bone);
    if (finger == 0 && thumbMetacarpal && part < 2) {
        const bool left = side == Side::Left;
        return part == 1 && (plain == (left ? "leftthumbproximal" : "rightthumbproximal") ||
                             plain == (left ? "thumbproximall" : "thumbproximalr"));
    }
    const int wanted = static_cast<int>(3 * finger + part);
    for (const rig_names::Finger& known : rig_names::kFingers)
        if (known.Side == static_cast<int>(side) && known.Bone == wanted && plain == known.Name) return true;
    return false;
}

BoneIndices FindBones(const std::vector<std::string>& names, const std::vector<int>& parents, Side side, const BoneMap& map) {
    const std::vector<std::string> known = Renamed(names, map);
    BoneIndices found;
    found.Fingers.fill(-1);
    bool metacarpal = false;
    for (const std::string& name : known) metacarpal = metacarpal || IsThumbMetacarpal(name, side);
    for (std::size_t i = 0; i < known.size(); ++i) {
        const int index = static_cast<int>(i);
        if (found.Hand < 0 && IsHandName(known[i], side)) found.Hand = index;
        for (std::size_t bone = 0; bone < kFingerBones; ++bone)
            if (found.Fingers[bone] < 0 && MatchesFinger(known[i], side, bone / 3, bone % 3, metacarpal))
                found.Fingers[bone] = index;
    }
    found.LowerArm = ArmAbove(names, parents, found.Hand);
    found.UpperArm = ArmAbove(names, parents, found.LowerArm);
    return found;
}

}  // namespace manipnet
