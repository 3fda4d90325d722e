#include "ManipNetLiveLinkSource.h"

#include "Core/AvatarClient.h"
#include "Core/LocalClock.h"
#include "Core/Timecode.h"
#include "Engine/SkeletalMesh.h"
#include "HAL/PlatformTime.h"
#include "ILiveLinkClient.h"
#include "ManipNetLiveLinkSourceSettings.h"
#include "ManipNetSettings.h"
#include "ManipNetSkeletons.h"
#include "Misc/FrameRate.h"
#include "Misc/QualifiedFrameTime.h"
#include "Misc/Timecode.h"
#include "Roles/LiveLinkAnimationRole.h"
#include "Roles/LiveLinkAnimationTypes.h"
#include "Roles/LiveLinkTransformRole.h"
#include "Roles/LiveLinkTransformTypes.h"

#define LOCTEXT_NAMESPACE "ManipNetLiveLink"

namespace
{
constexpr double LookEveryS = 0.5;  // a subject appears in Live Link one tick after it was described
constexpr double SilentAfterS = 1.0;

FTransform ToTransform(const manipnet::UnrealPose& Pose)
{
    return FTransform(FQuat(Pose.QX, Pose.QY, Pose.QZ, Pose.QW), FVector(Pose.X, Pose.Y, Pose.Z));
}

FLiveLinkStaticDataStruct DescribeHand(bool bAvatar)
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
    Skeleton.PropertyNames.Add(FName(ManipNetSkeletons::WeightProperty));
    if (bAvatar)
    {
        Skeleton.PropertyNames.Add(FName(ManipNetSkeletons::AvatarProperty));
    }
    return Static;
}

/// Sets the times of a frame: that of the engine or of the capture, and the tracker's timecode if it sends one.
void SetTimes(FLiveLinkBaseFrameData& Data, const manipnet::HandsFrame& Frame, double Time)
{
    Data.WorldTime = FLiveLinkWorldTime(Time);
    manipnet::Timecode Read;
    if (manipnet::ParseTimecode(Frame.TimecodeText.Text, static_cast<double>(Frame.TimecodeRate), Read))
    {
        const FTimecode Timecode(Read.Hours, Read.Minutes, Read.Seconds, Read.Frames, Read.DropFrame);
        const FFrameRate Rate(static_cast<uint32>(Read.Numerator), static_cast<uint32>(Read.Denominator));
        Data.MetaData.SceneTime = FQualifiedFrameTime(Timecode, Rate);
    }
}

/// The name of the avatar's mesh, the last part of its path; empty for no avatar.
std::string NameOfAvatar(const manipnet::Connection& To)
{
    return To.Avatar.substr(To.Avatar.find_last_of("./") + 1);
}

FName SubjectName(const manipnet::HandsFrame& Frame, const manipnet::Connection& To, const std::string& Part)
{
    const std::string Avatar = NameOfAvatar(To);
    const std::string Name = "ManipNet_" + std::string(Frame.Actor.Text) + (Avatar.empty() ? "_" : "_" + Avatar + "_") + Part;
    return FName(UTF8_TO_TCHAR(Name.c_str()));
}
}

FManipNetLiveLinkSource::FManipNetLiveLinkSource(const FString& ConnectionString)
    : Error(manipnet::ParseConnection(ManipNetSettings::ToText(ConnectionString), Connection))
{
}

void FManipNetLiveLinkSource::ReceiveClient(ILiveLinkClient* InClient, FGuid InSourceGuid)
{
    LiveLink = InClient;
    SourceGuid = InSourceGuid;
    Start();
}

TSubclassOf<ULiveLinkSourceSettings> FManipNetLiveLinkSource::GetSettingsClass() const
{
    return UManipNetLiveLinkSourceSettings::StaticClass();
}

void FManipNetLiveLinkSource::InitializeSettings(ULiveLinkSourceSettings* Settings)
{
    if (UManipNetLiveLinkSourceSettings* Own = Cast<UManipNetLiveLinkSourceSettings>(Settings))
    {
        ManipNetSettings::Show(CurrentConnection(), *Own);
        ManipNetSettings::ShowInLiveLink(CurrentConnection(), *Own);
    }
}

void FManipNetLiveLinkSource::OnSettingsChanged(ULiveLinkSourceSettings* Settings, const FPropertyChangedEvent&)
{
    UManipNetLiveLinkSourceSettings* Own = Cast<UManipNetLiveLinkSourceSettings>(Settings);
    if (!Own)
    {
        return;
    }
    manipnet::Connection Wanted;
    const std::string Problem = ManipNetSettings::Read(*Own, Wanted);
    const manipnet::Connection Before = CurrentConnection();
    const bool bRestart = Problem != Error || !Wanted.SameStream(Before);
    {
        const std::lock_guard<std::mutex> Guard(Lock);
        Connection = Wanted;
    }
    if (Problem.empty())
    {
        ManipNetSettings::ShowInLiveLink(Wanted, *Own);
    }
    if (bRestart)
    {
        Error = Problem;
        Retire();
        Start();
    }
    else if (Client)
    {
        Client->SetDelay(Wanted.DelayS);
    }
}

void FManipNetLiveLinkSource::Start()
{
    {
        const std::lock_guard<std::mutex> Guard(Lock);
        Described.Empty();
    }
    if (Error.empty() && LiveLink)
    {
        const manipnet::Connection To = CurrentConnection();
        Client = !To.Avatar.empty() ? StartAvatar(To) : std::make_unique<manipnet::Client>(
            To, [this](const manipnet::HandsFrame& Frame) { PushRaw(Frame); });
    }
}

/// Makes the hand profile of the avatar, and a client that uploads it. Returns null, and sets the error, if that fails.
std::unique_ptr<manipnet::Client> FManipNetLiveLinkSource::StartAvatar(const manipnet::Connection& To)
{
    const USkeletalMesh* Mesh = LoadObject<USkeletalMesh>(nullptr, UTF8_TO_TCHAR(To.Avatar.c_str()));
    manipnet::BoneMap Map;
    Error = Mesh ? manipnet::ParseBoneMap(To.AvatarBones, Map) : "the avatar " + To.Avatar + " cannot be loaded; choose a skeletal mesh of this project";
    if (!Error.empty())
    {
        return nullptr;
    }
    const manipnet::RestSkeleton Rest = ManipNetSkeletons::ToRest(Mesh->GetRefSkeleton());
    manipnet::HandProfile Left, Right;
    manipnet::CharacterHand Hand;
    const std::string LeftProblem = Hand.Profile(Rest, manipnet::Side::Left, Map, Left);
    const std::string RightProblem = Hand.Profile(Rest, manipnet::Side::Right, Map, Right);
    if (!LeftProblem.empty() && !RightProblem.empty())
    {
        Error = "the avatar has no hands: " + LeftProblem + "; " + RightProblem;
        return nullptr;
    }
    const manipnet::HandProfile* LeftHand = LeftProblem.empty() ? &Left : nullptr;
    const manipnet::HandProfile* RightHand = RightProblem.empty() ? &Right : nullptr;
    const std::string Name = manipnet::ProfileName(NameOfAvatar(To), To.Actor, LeftHand, RightHand);
    return std::make_unique<manipnet::AvatarClient>(To, Name, manipnet::ProfileJson(Name, LeftHand, RightHand),
        [this](const manipnet::HandsFrame& Frame) { PushRaw(Frame); });
}

void FManipNetLiveLinkSource::Retire()
{
    if (Client)
    {
        Client->Stop();
        Retired.push_back(std::move(Client));
    }
}

void FManipNetLiveLinkSource::Update()
{
    for (std::size_t Index = Retired.size(); Index-- > 0;)
    {
        if (Retired[Index]->HasStopped())
        {
            Retired.erase(Retired.begin() + static_cast<std::ptrdiff_t>(Index));
        }
    }
    ForgetRemovedSubjects();
    float Weight = 0.0f;
    if (!Client || CurrentConnection().Delivery == manipnet::Mode::Raw)
    {
        return;
    }
    // After the fade nothing is pushed, so that Live Link shows the subject as stale.
    if (Client->Sample(manipnet::LocalNow(), Shown, Weight) && Weight > 0.0f)
    {
        PushFrame(Shown, Weight, FPlatformTime::Seconds());
    }
}

/// Forgets the subjects that a user removed, so that they are described anew.
void FManipNetLiveLinkSource::ForgetRemovedSubjects()
{
    const double Now = manipnet::LocalNow();
    if (!LiveLink || Now - Looked < LookEveryS)
    {
        return;
    }
    Looked = Now;
    TSet<FName> Present;
    for (const FLiveLinkSubjectKey& Key : LiveLink->GetSubjects(true, false))
    {
        if (Key.Source == SourceGuid)
        {
            Present.Add(Key.SubjectName.Name);
        }
    }
    const std::lock_guard<std::mutex> Guard(Lock);
    Described = Described.FilterByPredicate([&Present, Now](const TPair<FName, double>& Subject)
        { return Present.Contains(Subject.Key) || Now - Subject.Value < LookEveryS; });
}

/// Whether Live Link must first get the static data of a subject.
bool FManipNetLiveLinkSource::MustDescribe(const FName& Name)
{
    const std::lock_guard<std::mutex> Guard(Lock);
    if (Described.Contains(Name))
    {
        return false;
    }
    Described.Add(Name, manipnet::LocalNow());
    return true;
}

manipnet::Connection FManipNetLiveLinkSource::CurrentConnection() const
{
    const std::lock_guard<std::mutex> Guard(Lock);
    return Connection;
}

/// Called on the client's thread.
void FManipNetLiveLinkSource::PushRaw(const manipnet::HandsFrame& Frame)
{
    if (CurrentConnection().Delivery == manipnet::Mode::Raw)
    {
        // Live Link compares the time of capture with the time of arrival and finds the offset between both clocks.
        PushFrame(Frame, 1.0f, Frame.TCapture);
    }
}

void FManipNetLiveLinkSource::PushFrame(const manipnet::HandsFrame& Frame, float Weight, double Time)
{
    PushHand(Frame, manipnet::Side::Left, Weight, Time);
    PushHand(Frame, manipnet::Side::Right, Weight, Time);
    for (std::size_t Index = 0; Index < Frame.BodyCount; ++Index)
    {
        PushBody(Frame, Frame.Bodies[Index], Time);
    }
}

void FManipNetLiveLinkSource::PushHand(const manipnet::HandsFrame& Frame, manipnet::Side Side, float Weight, double Time)
{
    const manipnet::HandFrame& Hand = Frame.Hand(Side);
    if (!Hand.Present)
    {
        return;
    }
    const manipnet::Connection To = CurrentConnection();
    const FName Name = SubjectName(Frame, To, Side == manipnet::Side::Left ? "left" : "right");
    const FLiveLinkSubjectKey Key(SourceGuid, Name);
    if (MustDescribe(Name))
    {
        LiveLink->PushSubjectStaticData_AnyThread(Key, ULiveLinkAnimationRole::StaticClass(), DescribeHand(!To.Avatar.empty()));
    }
    FLiveLinkFrameDataStruct Data(FLiveLinkAnimationFrameData::StaticStruct());
    FLiveLinkAnimationFrameData& Animation = *Data.Cast<FLiveLinkAnimationFrameData>();
    manipnet::Skeleton::Poses Poses;
    manipnet::Skeleton::LocalPoses(Hand, To.Place, Poses);
    for (const manipnet::UnrealPose& Pose : Poses)
    {
        Animation.Transforms.Add(ToTransform(Pose));
    }
    Animation.PropertyValues.Add(Weight);
    if (!To.Avatar.empty())
    {
        Animation.PropertyValues.Add(1.0f);
    }
    SetTimes(Animation, Frame, Time);
    LiveLink->PushSubjectFrameData_AnyThread(Key, MoveTemp(Data));
}

void FManipNetLiveLinkSource::PushBody(const manipnet::HandsFrame& Frame, const manipnet::BodyFrame& Body, double Time)
{
    if (!Body.Tracked)
    {
        return;
    }
    const manipnet::Connection To = CurrentConnection();
    const FName Name = SubjectName(Frame, To, Body.BodyName.Text);
    const FLiveLinkSubjectKey Key(SourceGuid, Name);
    if (MustDescribe(Name))
    {
        FLiveLinkStaticDataStruct Static(FLiveLinkTransformStaticData::StaticStruct());
        LiveLink->PushSubjectStaticData_AnyThread(Key, ULiveLinkTransformRole::StaticClass(), MoveTemp(Static));
    }
    FLiveLinkFrameDataStruct Data(FLiveLinkTransformFrameData::StaticStruct());
    FLiveLinkTransformFrameData& Pose = *Data.Cast<FLiveLinkTransformFrameData>();
    Pose.Transform = ToTransform(To.Place.Place(manipnet::ToUnreal(Body.Pose.data())));
    SetTimes(Pose, Frame, Time);
    LiveLink->PushSubjectFrameData_AnyThread(Key, MoveTemp(Data));
}

bool FManipNetLiveLinkSource::IsSourceStillValid() const
{
    if (!Client)
    {
        return false;
    }
    const manipnet::Stats Stats = Client->GetStats();
    return Stats.Received > 0 && Stats.AgeS < SilentAfterS;
}

/// Live Link calls this again until it returns true; it never waits for the thread.
bool FManipNetLiveLinkSource::RequestSourceShutdown()
{
    Retire();
    for (const std::unique_ptr<manipnet::Client>& Ending : Retired)
    {
        if (!Ending->HasStopped())
        {
            return false;
        }
    }
    Retired.clear();
    LiveLink = nullptr;
    return true;
}

FText FManipNetLiveLinkSource::GetSourceType() const
{
    return LOCTEXT("SourceType", "ManipNet");
}

FText FManipNetLiveLinkSource::GetSourceMachineName() const
{
    const manipnet::Connection To = CurrentConnection();
    return FText::FromString(FString::Printf(TEXT("%s:%d"), UTF8_TO_TCHAR(To.Host.c_str()), static_cast<int32>(To.Port)));
}

FText FManipNetLiveLinkSource::GetSourceStatus() const
{
    if (!Client)
    {
        return FText::FromString(Error.empty() ? FString(TEXT("closed")) : FString(UTF8_TO_TCHAR(Error.c_str())));
    }
    const manipnet::Stats Stats = Client->GetStats();
    if (Stats.State != "connected")
    {
        return FText::FromString(UTF8_TO_TCHAR(Stats.State.c_str()));
    }
    if (Stats.Received == 0)
    {
        return LOCTEXT("NoFrames", "connected, but no hands have arrived");
    }
    return FText::FromString(FString::Printf(
        TEXT("%.0f Hz, age %.0f ms, %lld lost"), Stats.RateHz, 1000.0 * Stats.AgeS, static_cast<long long>(Stats.Lost)));
}

#undef LOCTEXT_NAMESPACE
