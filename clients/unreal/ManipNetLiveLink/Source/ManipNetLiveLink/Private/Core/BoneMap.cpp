#include <cstdint>

#include "BoneNames.h"

namespace manipnet {
namespace {

/// Reads the little JSON that a bone map has: one object of texts.
class Reader {
public:
    explicit Reader(const std::string& text) : Text(text) {}

    /// Skips spaces and takes `wanted` if it comes next.
    bool Take(char wanted) {
        if (AtEnd() || Text[At] != wanted) return false;
        ++At;
        return true;
    }

    bool TakeText(std::string& value) {
        value.clear();
        if (!Take('"')) return false;
        while (At < Text.size() && Text[At] != '"') {
            if (Text[At] != '\\') value += Text[At++];
            else if (!TakeEscape(value)) return false;
        }
        return At++ < Text.size();
    }

    bool AtEnd() {
        while (At < Text.size() && (Text[At] == ' ' || Text[At] == '\t' || Text[At] == '\n' || Text[At] == '\r')) ++At;
        return At >= Text.size();
    }

    std::size_t Position() const { return At; }

private:
    bool TakeEscape(std::string& value) {
        const char kind = ++At < Text.size() ? Text[At++] : '\0';
        if (kind != 'u') {
            value += kind;
            return kind == '"' || kind == '\\' || kind == '/';
        }
        std::uint32_t point = 0, low = 0;
        if (!TakeHex(point)) return false;
        if (point >= 0xD800 && point < 0xDC00) {  // the first half of a character beyond 16 bits
            if (Text.compare(At, 2, "\\u") != 0) return false;
            At += 2;
            if (!TakeHex(low) || low < 0xDC00 || low > 0xDFFF) return false;
            point = 0x10000 + ((point - 0xD800) << 10) + (low - 0xDC00);
        }
        AppendUtf8(point, value);
        return true;
    }

    bool TakeHex(std::uint32_t& number) {
        number = 0;
        for (const std::size_t end = At + 4; At < end; ++At) {
            static const std::string kDigits = "0123456789abcdef";
            const std::size_t digit = At < Text.size() ? kDigits.find(static_cast<char>(Text[At] | ('A' <= Text[At] && Text[At] <= 'F' ? 0x20 : 0))) : std::string::npos;
            if (digit == std::string::npos) return false;
            number = 16 * number + static_cast<std::uint32_t>(digit);
        }
        return true;
    }

    static void AppendUtf8(std::uint32_t point, std::string& value) {
        const auto add = [&value](std::uint32_t byte) { value += static_cast<char>(static_cast<unsigned char>(byte)); };
        if (point < 0x80) return add(point);
        if (point < 0x800) {
            add(0xC0 | (point >> 6));
        } else {
            if (point < 0x10000) {
                add(0xE0 | (point >> 12));
            } else {
                add(0xF0 | (point >> 18));
                add(0x80 | ((point >> 12) & 0x3F));
            }
            add(0x80 | ((point >> 6) & 0x3F));
        }
        add(0x80 | (point & 0x3F));
    }

    const std::string& Text;
    std::size_t At = 0;
};

bool IsKnown(const std::string& name) {
    for (const Side side : {Side::Left, Side::Right}) {
        if (IsHandName(name, side)) return true;
        for (std::size_t bone = 0; bone < kFingerBones; ++bone)
            if (MatchesFinger(name, side, bone / 3, bone % 3, false)) return true;
    }
    return false;
}

}  // namespace

std::string ParseBoneMap(const std::string& json, BoneMap& map) {
    map.clear();
    Reader reader(json);
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
