#include "BoneNames.h"
#include "Json.h"

namespace manipnet {
namespace {

bool IsKnown(const std::string& name) {
    for (const Side side : {Side::Left, Side::Right}) {
        if (IsHandName(name, side) || IsMetacarpal(name, side)) return true;
        for (std::size_t bone = 0; bone < kFingerBones; ++bone)
            if (MatchesFinger(name, side, bone / 3, bone % 3, false)) return true;
    }
    return false;
}

}  // namespace

std::string ParseBoneMap(const std::string& json, BoneMap& map) {
    map.clear();
    JsonReader reader(json);
    if (reader.AtEnd()) return {};
    bool good = reader.Take('{');
    bool more = good && !reader.Take('}');
    while (more) {
        std::string meaning, bone;
        good = reader.TakeText(meaning) && reader.Take(':') && reader.TakeText(bone);
        if (!good) break;
        if (!IsKnown(meaning))
            return "the bone map names \"" + meaning + "\"; allowed are names like LeftHand, LeftHandIndex1 or RightThumbProximal";
        map[meaning] = bone;
        more = reader.Take(',');
        good = more || reader.Take('}');
        if (!good) break;
    }
    if (good && reader.AtEnd()) return {};
    return "the bone map is not JSON at character " + std::to_string(reader.Position() + 1) +
           R"(; allowed is {"LeftHandIndex1": "a bone of the skeleton", ...})";
}

}  // namespace manipnet
