#include "ManipNetRetargetAsset.h"

#include "BoneContainer.h"
#include "BonePose.h"
#include "Core/SubjectHand.h"
#include "ManipNetSkeletons.h"
#include "ReferenceSkeleton.h"
#include "Roles/LiveLinkAnimationTypes.h"

DEFINE_LOG_CATEGORY_STATIC(LogManipNet, Log, All);

using namespace ManipNetSkeletons;

namespace
{

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

bool IsSolvedOnAvatar(const FLiveLinkSkeletonStaticData& Static)
{
    return Static.PropertyNames.IndexOfByKey(FName(AvatarProperty)) != INDEX_NONE;
}

/// A property of the subject, or `Otherwise` if it has none of this name.
double PropertyOf(const FLiveLinkSkeletonStaticData& Static, const FLiveLinkAnimationFrameData& Frame, const TCHAR* Name, double Otherwise)
{
    const int32 Index = Static.PropertyNames.IndexOfByKey(FName(Name));
    return Frame.PropertyValues.IsValidIndex(Index) ? static_cast<double>(Frame.PropertyValues[Index]) : Otherwise;
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
    bool bExact = false;
    manipnet::SubjectHand Subject;
    manipnet::Side Side = manipnet::Side::Left;
    manipnet::CharacterHand Character;

    bool Fits(const FLiveLinkSkeletonStaticData& Static, const FReferenceSkeleton& InSkeleton, const FString& InMap) const
    {
        return SubjectBones == Static.BoneNames && bExact == IsSolvedOnAvatar(Static) && Skeleton == &InSkeleton && BoneCount == InSkeleton.GetNum() && BoneMap == InMap;
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
        bExact = IsSolvedOnAvatar(Static);
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
            const manipnet::RestSkeleton Rest = ToRest(InSkeleton);
            Problem = bExact ? Character.BindExactly(Rest, Side, Map) : Character.Bind(Rest, Side, Map);
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
    const bool bFits = Binding.IsValid() && Binding->Fits(*InSkeletonData, Skeleton, BoneMap);
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
    const double Weight = PropertyOf(*InSkeletonData, *InFrameData, WeightProperty, 1.0);
    Binding->Character.Apply(Binding->Subject.Read(Local), bMoveWrist, Weight, Pose);
}
