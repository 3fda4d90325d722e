// What the plugin assumes about Unreal's API, as facts: each was read in a public copy of the engine's header and is
// checked against the stubs, so that plugin, stubs and engine agree. A fact whose versions are "5.2, 5.8" was read at both
// ends of what we support (5.3 to 5.6) and is the same there.
#include <type_traits>

#include "Unreal.h"

#define FACT(header, versions, ...) static_assert(__VA_ARGS__, header ", " versions)

template <typename Member, typename Expected>
constexpr bool Is = std::is_same_v<Member, Expected>;

FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkSource::ReceiveClient), void (ILiveLinkSource::*)(ILiveLinkClient*, FGuid)>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkSource::InitializeSettings), void (ILiveLinkSource::*)(ULiveLinkSourceSettings*)>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8", Is<decltype(&ILiveLinkSource::Update), void (ILiveLinkSource::*)()>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkSource::IsSourceStillValid), bool (ILiveLinkSource::*)() const>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkSource::RequestSourceShutdown), bool (ILiveLinkSource::*)()>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkSource::GetSourceStatus), FText (ILiveLinkSource::*)() const>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkSource::GetSettingsClass), TSubclassOf<ULiveLinkSourceSettings> (ILiveLinkSource::*)() const>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkSource::OnSettingsChanged),
        void (ILiveLinkSource::*)(ULiveLinkSourceSettings*, const FPropertyChangedEvent&)>);

FACT("LiveLinkInterface/Public/ILiveLinkClient.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkClient::PushSubjectStaticData_AnyThread),
        void (ILiveLinkClient::*)(const FLiveLinkSubjectKey&, TSubclassOf<ULiveLinkRole>, FLiveLinkStaticDataStruct&&)>);
FACT("LiveLinkInterface/Public/ILiveLinkClient.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkClient::PushSubjectFrameData_AnyThread),
        void (ILiveLinkClient::*)(const FLiveLinkSubjectKey&, FLiveLinkFrameDataStruct&&)>);
FACT("LiveLinkInterface/Public/ILiveLinkClient.h", "5.2, 5.8",
     Is<decltype(&ILiveLinkClient::GetSubjects), TArray<FLiveLinkSubjectKey> (ILiveLinkClient::*)(bool, bool) const>);

FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", Is<decltype(FLiveLinkMetaData::SceneTime), FQualifiedFrameTime>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", Is<decltype(FLiveLinkBaseFrameData::WorldTime), FLiveLinkWorldTime>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", Is<decltype(FLiveLinkBaseFrameData::MetaData), FLiveLinkMetaData>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", Is<decltype(FLiveLinkBaseFrameData::PropertyValues), TArray<float>>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", Is<decltype(FLiveLinkBaseStaticData::PropertyNames), TArray<FName>>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", Is<decltype(FLiveLinkSubjectKey::Source), FGuid>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", Is<decltype(FLiveLinkSubjectName::Name), FName>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "5.2", std::is_convertible_v<double, FLiveLinkWorldTime>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkAnimationTypes.h", "5.2",
     Is<decltype(FLiveLinkAnimationFrameData::Transforms), TArray<FTransform>>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkAnimationTypes.h", "5.2",
     Is<decltype(FLiveLinkSkeletonStaticData::BoneNames), TArray<FName>>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkAnimationTypes.h", "5.2",
     Is<decltype(FLiveLinkSkeletonStaticData::BoneParents), TArray<int32>>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkTransformTypes.h", "5.2",
     Is<decltype(FLiveLinkTransformFrameData::Transform), FTransform>);
FACT("LiveLinkInterface/Public/LiveLinkSourceSettings.h", "5.2",
     Is<decltype(ULiveLinkSourceSettings::ConnectionString), FString>);
FACT("LiveLinkInterface/Public/LiveLinkSourceSettings.h", "5.2",
     Is<decltype(ULiveLinkSourceSettings::BufferSettings), FLiveLinkSourceBufferManagementSettings>);
FACT("Core/Public/Misc/QualifiedFrameTime.h", "5.2",
     std::is_constructible_v<FQualifiedFrameTime, const FTimecode&, const FFrameRate&>);
FACT("Core/Public/Misc/Timecode.h", "5.2", std::is_constructible_v<FTimecode, int32, int32, int32, int32, bool>);
FACT("Core/Public/Misc/FrameRate.h", "5.2", std::is_constructible_v<FFrameRate, uint32, uint32>);

FACT("LiveLinkAnimationCore/Public/LiveLinkRetargetAsset.h", "5.2",
     Is<decltype(&ULiveLinkRetargetAsset::BuildPoseFromAnimationData),
        void (ULiveLinkRetargetAsset::*)(float, const FLiveLinkSkeletonStaticData*, const FLiveLinkAnimationFrameData*, FCompactPose&)>);
FACT("Engine/Public/BoneContainer.h", "5.2",
     Is<decltype(&FBoneContainer::GetReferenceSkeleton), const FReferenceSkeleton& (FBoneContainer::*)() const>);
FACT("Engine/Public/BoneContainer.h", "5.2",
     Is<decltype(&FBoneContainer::MakeCompactPoseIndex),
        FCompactPoseBoneIndex (FBoneContainer::*)(const FMeshPoseBoneIndex&) const>);
FACT("Engine/Public/BonePose.h", "5.2", Is<decltype(&FCompactPose::GetBoneContainer), const FBoneContainer& (FCompactPose::*)() const>);
FACT("Engine/Public/ReferenceSkeleton.h", "5.2",
     Is<decltype(&FReferenceSkeleton::GetRefBonePose), const TArray<FTransform>& (FReferenceSkeleton::*)() const>);
FACT("Engine/Public/ReferenceSkeleton.h", "5.2",
     Is<decltype(&FReferenceSkeleton::GetBoneName), FName (FReferenceSkeleton::*)(int32) const>);
FACT("Engine/Public/ReferenceSkeleton.h", "5.2",
     Is<decltype(&FReferenceSkeleton::GetParentIndex), int32 (FReferenceSkeleton::*)(int32) const>);
