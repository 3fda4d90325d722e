// One message, in memory that is reused. Axes are right-handed with Y up; metres, radians, quaternions xyzw.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "Layout.h"

namespace manipnet {

enum class Side { Left = 0, Right = 1 };

/// A short UTF-8 text with a terminating zero.
struct Name {
    std::uint8_t Length = 0;
    char Text[layout::kNameBytes + 1] = {};

    bool operator==(const Name& other) const {
        return Length == other.Length && std::memcmp(Text, other.Text, Length) == 0;
    }
    bool operator!=(const Name& other) const { return !(*this == other); }
};

struct HandFrame {
    bool Present = false;
    bool HasObject = false;
    std::uint8_t State = 0;  ///< An index of layout::kStates.
    Name Object;
    float Scale = 1.0F;
    std::array<float, layout::kAngleCount> Angles{};
    std::array<float, 4 * layout::kBoneCount> Rotations{};  ///< Relative to the parent bone.
    std::array<float, 7> Wrist{};                           ///< Position and quaternion in the world.
    std::array<float, 7 * layout::kJointCount> Joints{};    ///< OpenXR joints in the world.
};

struct BodyFrame {
    bool Tracked = false;
    Name BodyName;
    std::array<float, 7> Pose{};
};

struct HandsFrame {
    Name Session;
    Name Actor;
    std::uint64_t Seq = 0;
    double TCapture = 0.0;
    double TPublish = 0.0;
    double LookAhead = 0.0;
    std::array<float, 5> LatencyMs{};
    Name TimecodeText;          ///< "HH:MM:SS:FF" of the instant, empty if the tracker sends none.
    float TimecodeRate = 0.0F;  ///< Frames per second, 0 if it is not known.
    std::array<HandFrame, 2> Hands;  ///< Indexed by Side.
    std::size_t BodyCount = 0;       ///< Used part of Bodies, which never shrinks, so that frames allocate nothing.
    std::vector<BodyFrame> Bodies;

    const HandFrame& Hand(Side side) const { return Hands[static_cast<std::size_t>(side)]; }

    void SetBodyCount(std::size_t count) {
        if (count > Bodies.size()) Bodies.resize(count);
        BodyCount = count;
    }

    /// Copies like an assignment, but keeps the memory for bodies.
    void CopyFrom(const HandsFrame& other) {
        Session = other.Session;
        Actor = other.Actor;
        Seq = other.Seq;
        TCapture = other.TCapture;
        TPublish = other.TPublish;
        LookAhead = other.LookAhead;
        LatencyMs = other.LatencyMs;
        TimecodeText = other.TimecodeText;
        TimecodeRate = other.TimecodeRate;
        Hands = other.Hands;
        SetBodyCount(other.BodyCount);
        for (std::size_t i = 0; i < BodyCount; ++i) Bodies[i] = other.Bodies[i];
    }
};

}  // namespace manipnet
