#include "Connection.h"

#include <algorithm>
#include <cstdlib>
#include <sstream>

namespace manipnet {
namespace {

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

std::string ParseDelay(const std::string& value, Connection& connection) {
    char* end = nullptr;
    const double delay = std::strtod(value.c_str(), &end);
    if (value.empty() || *end != '\0' || !(delay >= 0.0 && delay <= Connection::kMaxDelayS))
        return "the delay is \"" + value + "\"; allowed are 0 to 1 seconds";
    connection.DelayS = delay;
    return {};
}

}  // namespace

std::string ParseConnection(const std::string& text, Connection& connection) {
    connection = Connection();
    std::istringstream words(text);
    std::string word;
    if (!(words >> word)) return {};
    std::string error = ParseAddress(word, connection);
    while (error.empty() && words >> word) {
        const std::size_t equals = word.find('=');
        const std::string key = word.substr(0, equals);
        const std::string value = equals == std::string::npos ? std::string() : word.substr(equals + 1);
        if (key == "actor") {
            connection.Actor = value;
        } else if (key == "delay") {
            error = ParseDelay(value, connection);
        } else {
            error = "\"" + word + "\" is unknown; allowed after the address are actor=NAME and delay=SECONDS";
        }
    }
    return error;
}

}  // namespace manipnet
