#include "ManipNetLiveLinkSource.h"

#include "Core/LocalClock.h"
#include "Core/Skeleton.h"
#include "HAL/PlatformTime.h"
#include "ILiveLinkClient.h"
#include "LiveLinkTypes.h"
#include "Roles/LiveLinkAnimationRole.h"
#include "Roles/LiveLinkAnimationTypes.h"
#include "Roles/LiveLinkTransformRole.h"
#include "Roles/LiveLinkTransformTypes.h"

#define LOCTEXT_NAMESPACE "ManipNetLiveLink"

namespace
{
FTransform ToTransform(const manipnet::UnrealPose& Pose)
{
    return FTransform(FQuat(Pose.QX, Pose.QY, Pose.QZ, Pose.QW), FVector(Pose.X, Pose.Y, Pose.Z));
}

FLiveLinkStaticDataStruct DescribeHand()
{
    FLiveLinkStaticDataStruct Static(FLiveLinkSkeletonStaticData::StaticStruct());
    FLiveLinkSkeletonStaticData& Skeleton = *Static.Cast<FLiveLinkSkeletonStaticData>();
    TArray<FName> Names;
    TArray<int32> Parents;
    for (std::size_t Bone = 0; Bone < manipnet::Skeleton::kBones; ++Bone)
    {
        Names.Add(FName(UTF8_TO_TCHAR(manipnet::Skeleton::BoneName(Bone))));
        Parents.Add(manipnet::Skeleton::ParentOf(Bone));
    }
    Skeleton.SetBoneNames(Names);
    Skeleton.SetBoneParents(Parents);
    Skeleton.PropertyNames.Add(FName(TEXT("ManipNetWeight")));
    return Static;
}
}

FManipNetLiveLinkSource::FManipNetLiveLinkSource(const FString& ConnectionString)
    : Error(manipnet::ParseConnection(TCHAR_TO_UTF8(*ConnectionString), Connection))
{
}

void FManipNetLiveLinkSource::ReceiveClient(ILiveLinkClient* InClient, FGuid InSourceGuid)
{
    LiveLink = InClient;
    SourceGuid = InSourceGuid;
    Described.Empty();
    if (Error.empty())
    {
        Client = std::make_unique<manipnet::Client>(Connection);
    }
}

void FManipNetLiveLinkSource::Update()
{
    float Weight = 0.0f;
    // After the fade nothing is pushed, so that Live Link shows the subject as stale.
    if (!Client || !Client->Sample(manipnet::LocalNow(), Frame, Weight) || Weight <= 0.0f)
    {
        return;
    }
    PushHand(Frame.Hand(manipnet::Side::Left), TEXT("left"), Weight);
    PushHand(Frame.Hand(manipnet::Side::Right), TEXT("right"), Weight);
    for (std::size_t Index = 0; Index < Frame.BodyCount; ++Index)
    {
        PushBody(Frame.Bodies[Index]);
    }
}

void FManipNetLiveLinkSource::PushHand(const manipnet::HandFrame& Hand, const TCHAR* Side, float Weight)
{
    if (!Hand.Present)
    {
        return;
    }
    const FName Name = SubjectName(Side);
    const FLiveLinkSubjectKey Key(SourceGuid, Name);
    if (!Described.Contains(Name))
    {
        Described.Add(Name);
        LiveLink->PushSubjectStaticData_AnyThread(Key, ULiveLinkAnimationRole::StaticClass(), DescribeHand());
    }
    FLiveLinkFrameDataStruct Data(FLiveLinkAnimationFrameData::StaticStruct());
    FLiveLinkAnimationFrameData& Animation = *Data.Cast<FLiveLinkAnimationFrameData>();
    manipnet::Skeleton::Poses Poses;
    manipnet::Skeleton::LocalPoses(Hand, Poses);
    for (const manipnet::UnrealPose& Pose : Poses)
    {
        Animation.Transforms.Add(ToTransform(Pose));
    }
    Animation.PropertyValues.Add(Weight);
    Animation.WorldTime = FLiveLinkWorldTime(FPlatformTime::Seconds());
    LiveLink->PushSubjectFrameData_AnyThread(Key, MoveTemp(Data));
}

void FManipNetLiveLinkSource::PushBody(const manipnet::BodyFrame& Body)
{
    if (!Body.Tracked)
    {
        return;
    }
    const FName Name = SubjectName(UTF8_TO_TCHAR(Body.BodyName.Text));
    const FLiveLinkSubjectKey Key(SourceGuid, Name);
    if (!Described.Contains(Name))
    {
        Described.Add(Name);
        FLiveLinkStaticDataStruct Static(FLiveLinkTransformStaticData::StaticStruct());
        LiveLink->PushSubjectStaticData_AnyThread(Key, ULiveLinkTransformRole::StaticClass(), MoveTemp(Static));
    }
    FLiveLinkFrameDataStruct Data(FLiveLinkTransformFrameData::StaticStruct());
    FLiveLinkTransformFrameData& Pose = *Data.Cast<FLiveLinkTransformFrameData>();
    Pose.Transform = ToTransform(manipnet::ToUnreal(Body.Pose.data()));
    Pose.WorldTime = FLiveLinkWorldTime(FPlatformTime::Seconds());
    LiveLink->PushSubjectFrameData_AnyThread(Key, MoveTemp(Data));
}

FName FManipNetLiveLinkSource::SubjectName(const FString& Part) const
{
    return FName(*FString::Printf(TEXT("ManipNet_%s_%s"), UTF8_TO_TCHAR(Frame.Actor.Text), *Part));
}

bool FManipNetLiveLinkSource::IsSourceStillValid() const
{
    return Client != nullptr;
}

bool FManipNetLiveLinkSource::RequestSourceShutdown()
{
    Client.reset();
    LiveLink = nullptr;
    return true;
}

FText FManipNetLiveLinkSource::GetSourceType() const
{
    return LOCTEXT("SourceType", "ManipNet");
}

FText FManipNetLiveLinkSource::GetSourceMachineName() const
{
    return FText::FromString(FString::Printf(TEXT("%s:%d"), UTF8_TO_TCHAR(Connection.Host.c_str()), Connection.Port));
}

FText FManipNetLiveLinkSource::GetSourceStatus() const
{
    if (!Client)
    {
        return FText::FromString(Error.empty() ? FString(TEXT("closed")) : FString(UTF8_TO_TCHAR(Error.c_str())));
    }
    const manipnet::Stats Stats = Client->GetStats();
    if (Stats.State != "connected" || Stats.Received == 0)
    {
        return FText::FromString(UTF8_TO_TCHAR(Stats.State.c_str()));
    }
    return FText::FromString(FString::Printf(
        TEXT("%.0f Hz, age %.0f ms, %lld lost"), Stats.RateHz, 1000.0 * Stats.AgeS, static_cast<long long>(Stats.Lost)));
}

#undef LOCTEXT_NAMESPACE
