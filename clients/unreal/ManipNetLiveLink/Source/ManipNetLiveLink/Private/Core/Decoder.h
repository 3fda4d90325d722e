#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "HandsFrame.h"

namespace manipnet {

/// Reads the payload of `pose/bin`, see docs/protocol.md. Empty when it was read, else what was wrong, and the frame is
/// in an undefined state. Allocates only to explain a refusal.
std::string Decode(const std::uint8_t* data, std::size_t length, HandsFrame& frame);

}  // namespace manipnet
