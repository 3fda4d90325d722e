#include "BoneNames.h"

#include <algorithm>

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

/// The first bone of each plain name.
using PlainNames = std::map<std::string, int>;

void Add(const std::vector<std::string>& names, const std::string& prefix, PlainNames& byName) {
    for (std::size_t i = 0; i < names.size(); ++i) {
        const bool begins = names[i].compare(0, prefix.size(), prefix) == 0;
        byName.emplace(Plain(begins ? names[i].substr(prefix.size()) : names[i]), static_cast<int>(i));
    }
}

/// What all names begin with, up to a punctuation mark, such as the name of the skeleton in Motive.
std::string Prefix(const std::vector<std::string>& names) {
    std::vector<std::string> some;
    for (const std::string& name : names)
        if (Plain(name).find("hand") != std::string::npos) some.push_back(name);
    if (some.empty()) some = names;
    if (some.empty()) return {};
    const std::string first = *std::min_element(some.begin(), some.end());
    const std::string last = *std::max_element(some.begin(), some.end());
    std::size_t same = 0;
    while (same < first.size() && same < last.size() && first[same] == last[same]) ++same;
    const std::size_t mark = first.substr(0, same).find_last_of("_:-.");
    return mark == std::string::npos ? std::string() : first.substr(0, mark + 1);
}

/// Sets `bone` if the rig has the name and no earlier candidate was found.
void Take(const PlainNames& byName, const std::string& name, int& bone) {
    const auto found = byName.find(name);
    if (bone < 0 && found != byName.end()) bone = found->second;
}

/// VRM 1 and Godot count the thumb from its metacarpal, and VRChat counts it from zero.
void CountThumb(const PlainNames& byName, Side side, BoneIndices& found) {
    int metacarpal = -1;
    for (const rig_names::Hand& known : rig_names::kThumbMetacarpals)
        if (known.Side == static_cast<int>(side)) Take(byName, known.Name, metacarpal);
    const std::string end = side == Side::Left ? "l" : "r";
    if (metacarpal >= 0 && found.Fingers[0] >= 0) {
        found.Fingers[1] = found.Fingers[0];
        found.Fingers[0] = metacarpal;
    } else if (byName.count("thumb0" + end) > 0) {
        for (std::size_t part = 0; part < 3; ++part) {
            int bone = -1;
            Take(byName, "thumb" + std::to_string(part) + end, bone);
            if (bone >= 0) found.Fingers[part] = bone;
        }
    }
}

/// The tables list the candidates for a bone with the best first.
BoneIndices Lookup(const PlainNames& byName, Side side) {
    BoneIndices found;
    found.Fingers.fill(-1);
    found.Metacarpals.fill(-1);
    for (const rig_names::Hand& known : rig_names::kHands)
        if (known.Side == static_cast<int>(side)) Take(byName, known.Name, found.Hand);
    for (const rig_names::Finger& known : rig_names::kFingers)
        if (known.Side == static_cast<int>(side)) Take(byName, known.Name, found.Fingers[static_cast<std::size_t>(known.Bone)]);
    for (const rig_names::Finger& known : rig_names::kMetacarpals)
        if (known.Side == static_cast<int>(side))
            Take(byName, known.Name, found.Metacarpals[static_cast<std::size_t>(known.Bone) + 1]);
    CountThumb(byName, side, found);
    return found;
}

bool AnyFinger(const BoneIndices& bones) {
    return std::any_of(bones.Fingers.begin(), bones.Fingers.end(), [](int bone) { return bone >= 0; });
}

}  // namespace

bool IsThumbMetacarpal(const std::string& bone, Side side) { return IsOneOf(rig_names::kThumbMetacarpals, bone, side); }

bool IsMetacarpal(const std::string& bone, Side side) {
    const std::string plain = Plain(bone);
    for (const rig_names::Finger& known : rig_names::kMetacarpals)
        if (known.Side == static_cast<int>(side) && plain == known.Name) return true;
    return false;
}

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
    PlainNames byName;
    Add(known, {}, byName);
    BoneIndices found = Lookup(byName, side);
    if (!AnyFinger(found) && !AnyFinger(Lookup(byName, side == Side::Left ? Side::Right : Side::Left))) {
        Add(known, Prefix(known), byName);
        found = Lookup(byName, side);
    }
    found.LowerArm = ArmAbove(names, parents, found.Hand);
    found.UpperArm = ArmAbove(names, parents, found.LowerArm);
    return found;
}

}  // namespace manipnet
