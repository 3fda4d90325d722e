#include "Timecode.h"

#include <cmath>

namespace manipnet {
namespace {

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

int Number(const std::string& text, std::size_t at) { return 10 * (text[at] - '0') + (text[at + 1] - '0'); }

}  // namespace

bool ParseTimecode(const std::string& text, double rate, Timecode& timecode) {
    bool good = text.size() == 11 && rate > 0.5 && rate < 1000.0 && text[2] == ':' && text[5] == ':' &&
                (text[8] == ':' || text[8] == ';');
    for (const std::size_t at : {0U, 1U, 3U, 4U, 6U, 7U, 9U, 10U}) good = good && IsDigit(text[at]);
    if (!good) return false;
    timecode.Hours = Number(text, 0);
    timecode.Minutes = Number(text, 3);
    timecode.Seconds = Number(text, 6);
    timecode.Frames = Number(text, 9);
    timecode.DropFrame = text[8] == ';';
    // The rates of NTSC are n * 1000 / 1001. A counted rate of 30 with drop frames is 29.97 for the same reason.
    const int whole = static_cast<int>(std::lround(rate));
    const bool ntsc = timecode.DropFrame || std::fabs(rate - whole * 1000.0 / 1001.0) < std::fabs(rate - whole);
    timecode.Numerator = ntsc ? 1000 * whole : whole;
    timecode.Denominator = ntsc ? 1001 : 1;
    return timecode.Frames < whole;
}

}  // namespace manipnet
