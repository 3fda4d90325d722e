// Puts a Live Link frame on a character, on stubs of the engine. Standard input has: the class ("fingers" or "wrist"), a
// line with a bone map or an empty one, the number of bones and for each its name, parent, position, quaternion and scale
// at rest, the number of bones of the level of detail and their indices, the weight, then 26 names, parents, positions and
// quaternions of the subject's bones. Prints each bone's local pose, and on standard error what was logged.
#include <iostream>
#include <string>

#include "ManipNetRetargetAsset.h"
#include "Roles/LiveLinkAnimationTypes.h"

namespace {

FTransform ReadTransform() {
    double v[7];
    for (double& x : v) std::cin >> x;
    return FTransform(FQuat(v[3], v[4], v[5], v[6]), FVector(v[0], v[1], v[2]));
}

}  // namespace

int main() {
    std::string kind, map, name;
    std::getline(std::cin, kind);
    std::getline(std::cin, map);
    FReferenceSkeleton skeleton;
    int count = 0, parent = 0;
    std::cin >> count;
    for (int i = 0; i < count; ++i) {
        std::cin >> name >> parent;
        FTransform pose = ReadTransform();
        std::cin >> pose.Scale3D.X;
        pose.Scale3D.Y = pose.Scale3D.Z = pose.Scale3D.X;
        skeleton.Bones.Add({FName(name.c_str()), parent});
        skeleton.Pose.Add(pose);
    }
    FCompactPose pose;
    pose.Container.RefSkeleton = &skeleton;
    std::cin >> count;
    for (int i = 0, index = 0; i < count; ++i) {
        std::cin >> index;
        pose.Container.Indices.Add(index);
        pose.Bones.Add(skeleton.Pose[index]);
    }
    FLiveLinkSkeletonStaticData subject;
    FLiveLinkAnimationFrameData frame;
    float weight = 0.0F;
    std::cin >> weight;
    subject.PropertyNames.Add(FName("ManipNetWeight"));
    frame.PropertyValues.Add(weight);
    for (int i = 0; i < 26; ++i) {
        std::cin >> name >> parent;
        subject.BoneNames.Add(FName(name.c_str()));
        subject.BoneParents.Add(parent);
        frame.Transforms.Add(ReadTransform());
    }
    UManipNetRetargetAsset fingers{FObjectInitializer()};
    UManipNetWristRetargetAsset wrist{FObjectInitializer()};
    UManipNetRetargetAsset& asset = kind == "wrist" ? wrist : fingers;
    asset.BoneMap = FString(map.c_str());
    for (int again = 0; again < 2; ++again) asset.BuildPoseFromAnimationData(0.0F, &subject, &frame, pose);
    std::cout.precision(12);
    for (const FTransform& t : pose.Bones)
        std::cout << t.Translation.X << " " << t.Translation.Y << " " << t.Translation.Z << " " << t.Rotation.X << " "
                  << t.Rotation.Y << " " << t.Rotation.Z << " " << t.Rotation.W << " " << t.Scale3D.X << "\n";
    std::cerr << Logged();
}
