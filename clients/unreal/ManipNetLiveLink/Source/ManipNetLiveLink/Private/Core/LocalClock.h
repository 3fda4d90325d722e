#pragma once

#include <chrono>

namespace manipnet {

/// The time in seconds of a clock that never goes back.
inline double LocalNow() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace manipnet
