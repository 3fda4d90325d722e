#include "Decoder.h"

#include <cmath>
#include <cstring>

namespace manipnet {
namespace {

static_assert(layout::kVersion == 1, "this decoder is written for version 1");

template <typename T>
T Read(const std::uint8_t* at) {
    T value;
    std::memcpy(&value, at, sizeof value);  // all supported machines are little-endian, as the message is
    return value;
}

template <std::size_t N>
bool ReadFloats(const std::uint8_t* at, std::array<float, N>& into) {
    std::memcpy(into.data(), at, sizeof(float) * N);
    bool finite = true;
    for (float value : into) finite &= std::isfinite(value);
    return finite;
}

/// The length of the UTF-8 character at `text`, or 0 if it is malformed (overlong, a surrogate or cut off).
std::size_t CharacterLength(const std::uint8_t* text, std::size_t left) {
    const std::uint8_t lead = text[0];
    if (lead < 0x80) return 1;
    const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
    if (lead < 0xC2 || lead > 0xF4 || length > left) return 0;
    for (std::size_t i = 1; i < length; ++i)
        if ((text[i] & 0xC0) != 0x80) return 0;
    const bool overlong = (lead == 0xE0 && text[1] < 0xA0) || (lead == 0xF0 && text[1] < 0x90);
    const bool beyond = (lead == 0xED && text[1] > 0x9F) || (lead == 0xF4 && text[1] > 0x8F);
    return overlong || beyond ? 0 : length;
}

bool ReadName(const std::uint8_t* at, Name& name) {
    const std::size_t length = at[0];
    if (length > layout::kNameBytes) return false;
    for (std::size_t i = 0; i < length;) {
        const std::size_t step = CharacterLength(at + 1 + i, length - i);
        if (step == 0) return false;
        i += step;
    }
    name.Length = static_cast<std::uint8_t>(length);
    std::memcpy(name.Text, at + 1, length);
    name.Text[length] = '\0';
    return true;
}

/// Reads the timecode behind the header's older fields; a shorter header has none.
std::string ReadTimecode(const std::uint8_t* at, std::size_t headerSize, HandsFrame& frame) {
    frame.TimecodeText = Name();
    frame.TimecodeRate = 0.0F;
    if (headerSize < layout::kTimedHeaderBytes) return {};
    frame.TimecodeRate = Read<float>(at + layout::kHeaderTimecodeRate);
    if (!ReadName(at + layout::kHeaderTimecode, frame.TimecodeText)) return "the timecode is too long or not UTF-8";
    return std::isfinite(frame.TimecodeRate) ? std::string() : "the rate of the timecode is not finite";
}

std::string ReadHeader(const std::uint8_t* at, HandsFrame& frame) {
    frame.Seq = Read<std::uint64_t>(at + layout::kHeaderSeq);
    frame.TCapture = Read<double>(at + layout::kHeaderTCapture);
    frame.TPublish = Read<double>(at + layout::kHeaderTPublish);
    frame.LookAhead = Read<double>(at + layout::kHeaderLookAhead);
    for (HandFrame& hand : frame.Hands) hand.Present = false;
    const bool finite =
        std::isfinite(frame.TCapture) && std::isfinite(frame.TPublish) && std::isfinite(frame.LookAhead);
    if (!ReadFloats(at + layout::kHeaderLatencyMs, frame.LatencyMs) || !finite)
        return "the header has a number that is not finite";
    if (!ReadName(at + layout::kHeaderSession, frame.Session) || !ReadName(at + layout::kHeaderActor, frame.Actor))
        return "the name of the session or the actor is too long or not UTF-8";
    return {};
}

std::string ReadHand(const std::uint8_t* at, HandsFrame& frame) {
    const unsigned side = at[layout::kHandSide];
    const unsigned state = at[layout::kHandState];
    if (side > 1) return "the side is " + std::to_string(side) + "; allowed are 0 (left) and 1 (right)";
    if (state > 2) return "the state is " + std::to_string(state) + "; allowed are 0 (live), 1 (hold) and 2 (rest)";
    HandFrame& hand = frame.Hands[side];
    if (hand.Present) return "the same hand occurs twice; it may occur once";
    hand.Present = true;
    hand.State = static_cast<std::uint8_t>(state);
    hand.HasObject = at[layout::kHandHasObject] != 0;
    hand.Scale = Read<float>(at + layout::kHandScale);
    if (!ReadName(at + layout::kHandObject, hand.Object)) return "the object's name is too long or not UTF-8";
    const bool angles = ReadFloats(at + layout::kHandAngles, hand.Angles);
    const bool rotations = ReadFloats(at + layout::kHandRotations, hand.Rotations);
    const bool wrist = ReadFloats(at + layout::kHandWrist, hand.Wrist);
    const bool joints = ReadFloats(at + layout::kHandJoints, hand.Joints);
    if (!(angles && rotations && wrist && joints && std::isfinite(hand.Scale)))
        return "a hand has a number that is not finite";
    return {};
}

std::string ReadBody(const std::uint8_t* at, BodyFrame& body) {
    body.Tracked = at[layout::kBodyTracked] != 0;
    if (!ReadName(at + layout::kBodyName, body.BodyName)) return "a body's name is too long or not UTF-8";
    return ReadFloats(at + layout::kBodyPose, body.Pose) ? std::string() : "a body has a number that is not finite";
}

}  // namespace

std::string Decode(const std::uint8_t* data, std::size_t length, HandsFrame& frame) {
    if (length < layout::kHeaderBytes || Read<std::uint32_t>(data) != layout::kMagic)
        return "the message is not pose/bin; it must begin with MNPL and a complete header";
    const unsigned version = Read<std::uint16_t>(data + layout::kHeaderVersion);
    if (version != layout::kVersion)
        return "the message has version " + std::to_string(version) + "; this client understands version " +
               std::to_string(layout::kVersion);
    const std::size_t headerSize = Read<std::uint16_t>(data + layout::kHeaderHeaderSize);
    const std::size_t handSize = Read<std::uint16_t>(data + layout::kHeaderHandSize);
    const std::size_t bodySize = Read<std::uint16_t>(data + layout::kHeaderBodySize);
    const std::size_t hands = Read<std::uint16_t>(data + layout::kHeaderHandCount);
    const std::size_t bodies = Read<std::uint16_t>(data + layout::kHeaderBodyCount);
    if (headerSize < layout::kHeaderBytes || handSize < layout::kHandBytes || bodySize < layout::kBodyBytes)
        return "a record is shorter than its fields";
    if (hands > 2 || bodies > layout::kMaxBodies)
        return "the message has " + std::to_string(hands) + " hands and " + std::to_string(bodies) +
               " bodies; at most 2 and " +
               std::to_string(layout::kMaxBodies) + " are allowed";
    const std::size_t total = headerSize + hands * handSize + bodies * bodySize;
    if (length != total || Read<std::uint32_t>(data + layout::kHeaderTotalSize) != total)
        return "the message has " + std::to_string(length) + " bytes, but its header says " + std::to_string(total);

    std::string error = ReadHeader(data, frame);
    if (error.empty()) error = ReadTimecode(data, headerSize, frame);
    const std::uint8_t* at = data + headerSize;
    for (std::size_t i = 0; error.empty() && i < hands; ++i, at += handSize) error = ReadHand(at, frame);
    frame.SetBodyCount(error.empty() ? bodies : 0);
    for (std::size_t i = 0; error.empty() && i < bodies; ++i, at += bodySize) error = ReadBody(at, frame.Bodies[i]);
    return error;
}

}  // namespace manipnet
