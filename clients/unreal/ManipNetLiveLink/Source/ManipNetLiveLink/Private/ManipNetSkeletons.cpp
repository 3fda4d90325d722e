#include "ManipNetSkeletons.h"

#include "ReferenceSkeleton.h"

namespace ManipNetSkeletons
{
std::string ToText(const FName& Name)
{
    return std::string(TCHAR_TO_UTF8(*Name.ToString()));
}

manipnet::LocalBone ToLocal(const FTransform& Transform)
{
    const FQuat Q = Transform.GetRotation();
    const FVector T = Transform.GetTranslation();
    return {{Q.X, Q.Y, Q.Z, Q.W}, {T.X, T.Y, T.Z}, Transform.GetScale3D().X};
}

std::vector<manipnet::LocalBone> ToLocal(const TArray<FTransform>& Transforms)
{
    std::vector<manipnet::LocalBone> Local;
    Local.reserve(static_cast<std::size_t>(Transforms.Num()));
    for (const FTransform& Transform : Transforms)
    {
        Local.push_back(ToLocal(Transform));
    }
    return Local;
}

manipnet::RestSkeleton ToRest(const FReferenceSkeleton& Skeleton)
{
    manipnet::RestSkeleton Rest;
    for (int32 Bone = 0; Bone < Skeleton.GetNum(); ++Bone)
    {
        Rest.Names.push_back(ToText(Skeleton.GetBoneName(Bone)));
        Rest.Parents.push_back(Skeleton.GetParentIndex(Bone));
    }
    Rest.Local = ToLocal(Skeleton.GetRefBonePose());
    return Rest;
}
}
