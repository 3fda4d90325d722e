#include "ManipNetRetargetAsset.h"

#include "BoneContainer.h"
#include "BonePose.h"
#include "Core/SubjectHand.h"
#include "ReferenceSkeleton.h"
#include "Roles/LiveLinkAnimationTypes.h"

DEFINE_LOG_CATEGORY_STATIC(LogManipNet, Log, All);

namespace
{
const FName WeightName(TEXT("ManipNetWeight"));

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

/// The pose that an animation graph builds; a level of detail may lack bones.
class FPose final : public manipnet::CharacterPose
{
public:
    explicit FPose(FCompactPose& InPose) : Pose(InPose) {}

    virtual bool Has(int Bone) const override { return Index(Bone).GetInt() != INDEX_NONE; }
    virtual manipnet::LocalBone Get(int Bone) const override { return ToLocal(Pose[Index(Bone)]); }
    virtual void SetRotation(int Bone, const manipnet::Quat& Q) override
    {
        Pose[Index(Bone)].SetRotation(FQuat(Q.X, Q.Y, Q.Z, Q.W));
    }

private:
    FCompactPoseBoneIndex Index(int Bone) const
    {
        return Pose.GetBoneContainer().MakeCompactPoseIndex(FMeshPoseBoneIndex(Bone));
    }

    FCompactPose& Pose;
};

double WeightOf(const FLiveLinkSkeletonStaticData& Static, const FLiveLinkAnimationFrameData& Frame)
{
    const int32 Index = Static.PropertyNames.IndexOfByKey(WeightName);
    return Frame.PropertyValues.IsValidIndex(Index) ? static_cast<double>(Frame.PropertyValues[Index]) : 1.0;
}
}

/// What was found in a subject and a skeleton, until either changes.
struct FManipNetBinding
{
    TArray<FName> SubjectBones;
    const FReferenceSkeleton* Skeleton = nullptr;
    int32 BoneCount = 0;
    FString BoneMap;
    bool bHasJoints = false;
    manipnet::SubjectHand Subject;
    manipnet::Side Side = manipnet::Side::Left;
    manipnet::CharacterHand Character;

    bool Fits(const TArray<FName>& InBones, const FReferenceSkeleton& InSkeleton, const FString& InMap) const
    {
        return SubjectBones == InBones && Skeleton == &InSkeleton && BoneCount == InSkeleton.GetNum() && BoneMap == InMap;
    }

    void BindSubject(const FLiveLinkSkeletonStaticData& Static)
    {
        SubjectBones = Static.BoneNames;
        std::vector<std::string> Names;
        std::vector<int> Parents;
        for (const FName& Name : Static.BoneNames)
        {
            Names.push_back(ToText(Name));
        }
        for (const int32 Parent : Static.BoneParents)
        {
            Parents.push_back(Parent);
        }
        bHasJoints = Subject.Bind(Names, Parents);
        if (!bHasJoints)
        {
            UE_LOG(LogManipNet, Warning, TEXT("The subject has no hand: its bones must be the OpenXR joints, as those of ManipNet's subjects are."));
        }
    }

    void BindCharacter(const FReferenceSkeleton& InSkeleton, const FString& InMap)
    {
        Skeleton = &InSkeleton;
        BoneCount = InSkeleton.GetNum();
        BoneMap = InMap;
        manipnet::BoneMap Map;
        std::string Problem = manipnet::ParseBoneMap(TCHAR_TO_UTF8(*InMap), Map);
        if (Problem.empty())
        {
            Problem = Character.Bind(ToRest(InSkeleton), Side, Map);
        }
        if (!Problem.empty())
        {
            UE_LOG(LogManipNet, Warning, TEXT("ManipNet: %s"), UTF8_TO_TCHAR(Problem.c_str()));
        }
    }
};

UManipNetRetargetAsset::UManipNetRetargetAsset(const FObjectInitializer& ObjectInitializer)
    : Super(ObjectInitializer)
{
}

UManipNetWristRetargetAsset::UManipNetWristRetargetAsset(const FObjectInitializer& ObjectInitializer)
    : Super(ObjectInitializer)
{
    bMoveWrist = true;
}

void UManipNetRetargetAsset::BuildPoseFromAnimationData(float, const FLiveLinkSkeletonStaticData* InSkeletonData,
    const FLiveLinkAnimationFrameData* InFrameData, FCompactPose& OutPose)
{
    if (!InSkeletonData || !InFrameData || InFrameData->Transforms.Num() != InSkeletonData->BoneNames.Num())
    {
        return;
    }
    const FReferenceSkeleton& Skeleton = OutPose.GetBoneContainer().GetReferenceSkeleton();
    const std::vector<manipnet::LocalBone> Local = ToLocal(InFrameData->Transforms);
    const bool bFits = Binding.IsValid() && Binding->Fits(InSkeletonData->BoneNames, Skeleton, BoneMap);
    if (!bFits)
    {
        Binding = MakeShared<FManipNetBinding>();
        Binding->BindSubject(*InSkeletonData);
    }
    if (!Binding->bHasJoints)
    {
        return;
    }
    const manipnet::Side Side = Binding->Subject.SideOf(Local);
    if (!bFits || Side != Binding->Side)
    {
        Binding->Side = Side;
        Binding->BindCharacter(Skeleton, BoneMap);
    }
    FPose Pose(OutPose);
    Binding->Character.Apply(Binding->Subject.Read(Local), bMoveWrist, WeightOf(*InSkeletonData, *InFrameData), Pose);
}
