#pragma once

#include <string>

namespace manipnet {

/// An SMPTE timecode with its rate as a fraction.
struct Timecode {
    int Hours = 0, Minutes = 0, Seconds = 0, Frames = 0;
    bool DropFrame = false;
    int Numerator = 0, Denominator = 1;  ///< Frames per second.
};

/// Reads "HH:MM:SS:FF" (";" before FF for drop frame) at `rate` frames per second, 0 if it is not known. Returns false
/// if the text is not a timecode or the rate is not known.
bool ParseTimecode(const std::string& text, double rate, Timecode& timecode);

}  // namespace manipnet
