#include "Connection.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace manipnet {
namespace {

constexpr const char* kKeys = "actor=NAME, delay=SECONDS, mode=smooth or raw, yaw=DEGREES, origin=X,Y,Z, scale=FACTOR, control=PORT, avatar=PATH and bones=MAP";
constexpr double kMaxOriginCm = 1e7;

/// Splits a text at spaces outside of double quotes, which it removes.
std::vector<std::string> Words(const std::string& text) {
    std::vector<std::string> words;
    bool quoted = false;
    bool inside = false;
    for (const char c : text) {
        const bool space = !quoted && (c == ' ' || c == '\t' || c == '\n' || c == '\r');
        if (!space && !inside) words.emplace_back();
        inside = !space;
        if (c == '"') {
            quoted = !quoted;
        } else if (inside) {
            words.back() += c;
        }
    }
    return words;
}

std::string ParseAddress(const std::string& address, Connection& connection) {
    static const std::string kScheme = "tcp://";
    const std::size_t colon = address.rfind(':');
    bool good = address.compare(0, kScheme.size(), kScheme) == 0 && colon != std::string::npos && colon > kScheme.size();
    unsigned number = 0;
    for (std::size_t i = colon + 1; good && i < address.size(); ++i) {
        good = address[i] >= '0' && address[i] <= '9';
        number = std::min(10 * number + static_cast<unsigned>(address[i] - '0'), 65536U);
    }
    if (!good || number == 0 || number > 65535)
        return "the address is \"" + address + "\"; allowed is tcp://HOST:PORT, as in " + Connection::kDefault;
    connection.Host = address.substr(kScheme.size(), colon - kScheme.size());
    if (connection.Host.size() > 2 && connection.Host.front() == '[' && connection.Host.back() == ']')
        connection.Host = connection.Host.substr(1, connection.Host.size() - 2);
    connection.Port = static_cast<std::uint16_t>(number);
    return {};
}

/// Reads a number from `least` to `most` that ends at `stop`, and moves `at` behind it.
bool ReadNumber(const char*& at, char stop, double least, double most, double& value) {
    char* end = nullptr;
    const double number = std::strtod(at, &end);
    const bool good = end != at && *end == stop && number >= least && number <= most;
    at = end + (stop == '\0' ? 0 : 1);
    if (good) value = number;
    return good;
}

std::string ParseNumber(const char* what, const std::string& text, double least, double most, const char* allowed, double& value) {
    const char* at = text.c_str();
    if (ReadNumber(at, '\0', least, most, value)) return {};
    return std::string("the ") + what + " is \"" + text + "\"; allowed " + allowed;
}

std::string ParseOrigin(const std::string& text, Vec& origin) {
    const char* at = text.c_str();
    Vec read;
    if (ReadNumber(at, ',', -kMaxOriginCm, kMaxOriginCm, read.X) && ReadNumber(at, ',', -kMaxOriginCm, kMaxOriginCm, read.Y) &&
        ReadNumber(at, '\0', -kMaxOriginCm, kMaxOriginCm, read.Z)) {
        origin = read;
        return {};
    }
    return "the origin is \"" + text + "\"; allowed are three numbers in centimetres, as in 100,0,-50";
}

std::string ParseMode(const std::string& text, Mode& mode) {
    if (text != "smooth" && text != "raw") return "the mode is \"" + text + "\"; allowed are smooth and raw";
    mode = text == "raw" ? Mode::Raw : Mode::Smooth;
    return {};
}

std::string ParsePort(const std::string& text, std::uint16_t& port) {
    double number = 0.0;
    const char* allowed = "are 1 to 65535";
    std::string error = ParseNumber("control port", text, 1.0, 65535.0, allowed, number);
    if (error.empty()) port = static_cast<std::uint16_t>(number);
    return error;
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
        text.replace(at, from.size(), to);
    return text;
}

/// A setting with a text; one with spaces gets quotes.
std::string Setting(const char* key, const std::string& text) {
    if (text.empty()) return {};
    const bool spaces = text.find_first_of(" \t\r\n") != std::string::npos;
    return std::string(" ") + key + "=" + (spaces ? "\"" + text + "\"" : text);
}

std::string ParseSetting(const std::string& word, Connection& to) {
    const std::size_t equals = word.find('=');
    const std::string key = word.substr(0, equals);
    const std::string value = equals == std::string::npos ? std::string() : word.substr(equals + 1);
    if (key == "actor") {
        to.Actor = value;
        return {};
    }
    if (key == "delay") return ParseNumber("delay", value, 0.0, Connection::kMaxDelayS, "are 0 to 1 seconds", to.DelayS);
    if (key == "mode") return ParseMode(value, to.Delivery);
    if (key == "yaw") return ParseNumber("yaw", value, -360.0, 360.0, "are -360 to 360 degrees", to.Place.YawDegrees);
    if (key == "origin") return ParseOrigin(value, to.Place.Origin);
    if (key == "scale")
        return ParseNumber("scale", value, Connection::kMinScale, Connection::kMaxScale, "are 0.001 to 1000", to.Place.Scale);
    if (key == "control") return ParsePort(value, to.ControlPort);
    if (key == "avatar") {
        to.Avatar = value;
        return {};
    }
    if (key == "bones") {
        to.AvatarBones = Replaced(Replaced(value, "%22", "\""), "%25", "%");
        return {};
    }
    return "\"" + word + "\" is unknown; allowed after the address are " + kKeys;
}

std::string Short(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.9g", value);
    return text;
}

}  // namespace

std::string ParseConnection(const std::string& text, Connection& connection) {
    connection = Connection();
    const std::vector<std::string> words = Words(text);
    std::string error = words.empty() ? std::string() : ParseAddress(words[0], connection);
    for (std::size_t i = 1; error.empty() && i < words.size(); ++i) error = ParseSetting(words[i], connection);
    return error;
}

std::string FormatAddress(const Connection& c) {
    const bool brackets = c.Host.find(':') != std::string::npos;
    return "tcp://" + (brackets ? "[" + c.Host + "]" : c.Host) + ":" + std::to_string(c.Port);
}

std::string FormatConnection(const Connection& c) {
    const Connection standard;
    std::string text = FormatAddress(c);
    text += Setting("actor", c.Actor);
    if (c.DelayS != standard.DelayS) text += " delay=" + Short(c.DelayS);
    if (c.Delivery == Mode::Raw) text += " mode=raw";
    if (c.Place.YawDegrees != 0.0) text += " yaw=" + Short(c.Place.YawDegrees);
    const Vec& o = c.Place.Origin;
    if (o.X != 0.0 || o.Y != 0.0 || o.Z != 0.0) text += " origin=" + Short(o.X) + "," + Short(o.Y) + "," + Short(o.Z);
    if (c.Place.Scale != 1.0) text += " scale=" + Short(c.Place.Scale);
    if (c.ControlPort != standard.ControlPort) text += " control=" + std::to_string(c.ControlPort);
    text += Setting("avatar", c.Avatar);
    text += Setting("bones", Replaced(Replaced(c.AvatarBones, "%", "%25"), "\"", "%22"));
    return text;
}

}  // namespace manipnet
