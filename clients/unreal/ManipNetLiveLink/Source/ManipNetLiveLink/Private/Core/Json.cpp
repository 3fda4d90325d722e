#include "Json.h"

namespace manipnet {

bool JsonReader::Take(char wanted) {
    if (AtEnd() || Text[At] != wanted) return false;
    ++At;
    return true;
}

bool JsonReader::TakeText(std::string& value) {
    value.clear();
    if (!Take('"')) return false;
    while (At < Text.size() && Text[At] != '"') {
        if (Text[At] != '\\') value += Text[At++];
        else if (!TakeEscape(value)) return false;
    }
    return At++ < Text.size();
}

bool JsonReader::AtEnd() {
    while (At < Text.size() && (Text[At] == ' ' || Text[At] == '\t' || Text[At] == '\n' || Text[At] == '\r')) ++At;
    return At >= Text.size();
}

bool JsonReader::TakeEscape(std::string& value) {
    const char kind = ++At < Text.size() ? Text[At++] : '\0';
    if (kind != 'u') {
        static const std::string kLetters = "nrtbf";
        const std::size_t letter = kLetters.find(kind);
        value += letter == std::string::npos ? kind : "\n\r\t\b\f"[letter];
        return letter != std::string::npos || kind == '"' || kind == '\\' || kind == '/';
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

bool JsonReader::TakeHex(std::uint32_t& number) {
    number = 0;
    for (const std::size_t end = At + 4; At < end; ++At) {
        static const std::string kDigits = "0123456789abcdef";
        const std::size_t digit = At < Text.size() ? kDigits.find(static_cast<char>(Text[At] | ('A' <= Text[At] && Text[At] <= 'F' ? 0x20 : 0))) : std::string::npos;
        if (digit == std::string::npos) return false;
        number = 16 * number + static_cast<std::uint32_t>(digit);
    }
    return true;
}

void JsonReader::AppendUtf8(std::uint32_t point, std::string& value) {
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

std::string QuotedJson(const std::string& text) {
    std::string quoted = "\"";
    for (const char c : text) {
        if (c == '"' || c == '\\') quoted += '\\';
        if (static_cast<unsigned char>(c) >= 0x20) {
            quoted += c;
            continue;
        }
        char escape[8];
        std::snprintf(escape, sizeof escape, "\\u%04x", static_cast<unsigned>(static_cast<unsigned char>(c)));
        quoted += escape;
    }
    return quoted + "\"";
}

}  // namespace manipnet
