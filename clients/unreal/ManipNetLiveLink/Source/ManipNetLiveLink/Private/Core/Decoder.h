#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "HandsFrame.h"

namespace manipnet {

/// Decodes the payload of `pose/bin`, which docs/protocol.md describes. Fills the frame and returns an empty string, or
/// returns what is wrong and leaves the frame in an undefined state. Allocates only to explain a refusal.
std::string Decode(const std::uint8_t* data, std::size_t length, HandsFrame& frame);

}  // namespace manipnet
