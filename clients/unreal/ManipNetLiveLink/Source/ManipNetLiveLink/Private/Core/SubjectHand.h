#pragma once

#include <string>
#include <vector>

#include "CharacterHand.h"
#include "Axes.h"

namespace manipnet {

/// Finds a hand in a Live Link skeleton of OpenXR joints: the plugin's, that of the JSON output, or any other with these
/// names.
class SubjectHand {
public:
    /// Looks the joints up. Returns false if the skeleton lacks one of them.
    bool Bind(const std::vector<std::string>& names, const std::vector<int>& parents);

    /// Reads a hand from the bones of a frame, each relative to its parent.
    HandPose Read(const std::vector<LocalBone>& local) const;

    /// The side of the hand: index and little finger lie the other way round on the other hand.
    Side SideOf(const std::vector<LocalBone>& local) const;

private:
    LocalBone InWrist(std::size_t joint, const std::vector<LocalBone>& local) const;

    std::vector<int> Parents;
    std::vector<int> Joints;  ///< The bone of each joint of layout::kJointNames.
};

}  // namespace manipnet
