#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

namespace manipnet {

/// Reads the little JSON that bone maps and refusals consist of: objects of texts.
class JsonReader {
public:
    explicit JsonReader(const std::string& text) : Text(text) {}

    /// Skips spaces and takes `wanted` if it comes next.
    bool Take(char wanted);

    /// Takes a text. Returns false if none comes next.
    bool TakeText(std::string& value);

    bool AtEnd();
    std::size_t Position() const { return At; }

private:
    bool TakeEscape(std::string& value);
    bool TakeHex(std::uint32_t& number);
    static void AppendUtf8(std::uint32_t point, std::string& value);

    const std::string& Text;
    std::size_t At = 0;
};

/// A text in JSON, with its quotes.
std::string QuotedJson(const std::string& text);

}  // namespace manipnet
