// What the plugin assumes about Unreal's API, as facts that are checked against the stubs, so that plugin and stubs agree.
// Each fact says how it is known: "old and new" was read in a public copy of the header that is older than the versions
// we support (5.3 to 5.6) and in one that is newer; "5.4" in a copy of a branch between 5.3 and 5.5; "old" only in an older
// one; "assumed" was not read in a header. tests/clients/unreal_facts.py looks facts up in an engine's source.
#include <type_traits>

#include "Unreal.h"

#define FACT(header, known, ...) static_assert(__VA_ARGS__, header ": " known)

template <typename Member, typename Expected>
constexpr bool Is = std::is_same_v<Member, Expected>;

FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new",
     Is<decltype(&ILiveLinkSource::ReceiveClient), void (ILiveLinkSource::*)(ILiveLinkClient*, FGuid)>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new",
     Is<decltype(&ILiveLinkSource::InitializeSettings), void (ILiveLinkSource::*)(ULiveLinkSourceSettings*)>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new", Is<decltype(&ILiveLinkSource::Update), void (ILiveLinkSource::*)()>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new",
     Is<decltype(&ILiveLinkSource::IsSourceStillValid), bool (ILiveLinkSource::*)() const>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new",
     Is<decltype(&ILiveLinkSource::RequestSourceShutdown), bool (ILiveLinkSource::*)()>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new",
     Is<decltype(&ILiveLinkSource::GetSourceStatus), FText (ILiveLinkSource::*)() const>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new",
     Is<decltype(&ILiveLinkSource::GetSettingsClass), TSubclassOf<ULiveLinkSourceSettings> (ILiveLinkSource::*)() const>);
FACT("LiveLinkInterface/Public/ILiveLinkSource.h", "old and new",
     Is<decltype(&ILiveLinkSource::OnSettingsChanged),
        void (ILiveLinkSource::*)(ULiveLinkSourceSettings*, const FPropertyChangedEvent&)>);

FACT("LiveLinkInterface/Public/ILiveLinkClient.h", "old, 5.4 and new",
     Is<decltype(&ILiveLinkClient::PushSubjectStaticData_AnyThread),
        void (ILiveLinkClient::*)(const FLiveLinkSubjectKey&, TSubclassOf<ULiveLinkRole>, FLiveLinkStaticDataStruct&&)>);
FACT("LiveLinkInterface/Public/ILiveLinkClient.h", "old, 5.4 and new",
     Is<decltype(&ILiveLinkClient::PushSubjectFrameData_AnyThread),
        void (ILiveLinkClient::*)(const FLiveLinkSubjectKey&, FLiveLinkFrameDataStruct&&)>);
FACT("LiveLinkInterface/Public/ILiveLinkClient.h", "old, 5.4 and new",
     Is<decltype(&ILiveLinkClient::GetSubjects), TArray<FLiveLinkSubjectKey> (ILiveLinkClient::*)(bool, bool) const>);

FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", Is<decltype(FLiveLinkMetaData::SceneTime), FQualifiedFrameTime>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", Is<decltype(FLiveLinkBaseFrameData::WorldTime), FLiveLinkWorldTime>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", Is<decltype(FLiveLinkBaseFrameData::MetaData), FLiveLinkMetaData>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", Is<decltype(FLiveLinkBaseFrameData::PropertyValues), TArray<float>>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", Is<decltype(FLiveLinkBaseStaticData::PropertyNames), TArray<FName>>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", Is<decltype(FLiveLinkSubjectKey::Source), FGuid>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", Is<decltype(FLiveLinkSubjectName::Name), FName>);
FACT("LiveLinkInterface/Public/LiveLinkTypes.h", "old", std::is_convertible_v<double, FLiveLinkWorldTime>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkAnimationTypes.h", "old",
     Is<decltype(FLiveLinkAnimationFrameData::Transforms), TArray<FTransform>>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkAnimationTypes.h", "old",
     Is<decltype(FLiveLinkSkeletonStaticData::BoneNames), TArray<FName>>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkAnimationTypes.h", "old",
     Is<decltype(FLiveLinkSkeletonStaticData::BoneParents), TArray<int32>>);
FACT("LiveLinkInterface/Public/Roles/LiveLinkTransformTypes.h", "old",
     Is<decltype(FLiveLinkTransformFrameData::Transform), FTransform>);
FACT("LiveLinkInterface/Public/LiveLinkSourceSettings.h", "old and 5.4",
     Is<decltype(ULiveLinkSourceSettings::ConnectionString), FString>);
FACT("LiveLinkInterface/Public/LiveLinkSourceSettings.h", "old and 5.4",
     Is<decltype(ULiveLinkSourceSettings::BufferSettings), FLiveLinkSourceBufferManagementSettings>);
FACT("Core/Public/Misc/QualifiedFrameTime.h", "old",
     std::is_constructible_v<FQualifiedFrameTime, const FTimecode&, const FFrameRate&>);
FACT("Core/Public/Misc/Timecode.h", "old and 5.4", std::is_constructible_v<FTimecode, int32, int32, int32, int32, bool>);
FACT("Core/Public/Misc/FrameRate.h", "assumed", std::is_constructible_v<FFrameRate, uint32, uint32>);

FACT("LiveLinkAnimationCore/Public/LiveLinkRetargetAsset.h", "old",
     Is<decltype(&ULiveLinkRetargetAsset::BuildPoseFromAnimationData),
        void (ULiveLinkRetargetAsset::*)(float, const FLiveLinkSkeletonStaticData*, const FLiveLinkAnimationFrameData*, FCompactPose&)>);
FACT("Engine/Public/BoneContainer.h", "old",
     Is<decltype(&FBoneContainer::GetReferenceSkeleton), const FReferenceSkeleton& (FBoneContainer::*)() const>);
FACT("Engine/Public/BoneContainer.h", "old",
     Is<decltype(&FBoneContainer::MakeCompactPoseIndex),
        FCompactPoseBoneIndex (FBoneContainer::*)(const FMeshPoseBoneIndex&) const>);
FACT("Engine/Public/BonePose.h", "assumed", Is<decltype(&FCompactPose::GetBoneContainer), const FBoneContainer& (FCompactPose::*)() const>);
FACT("Engine/Public/ReferenceSkeleton.h", "old",
     Is<decltype(&FReferenceSkeleton::GetRefBonePose), const TArray<FTransform>& (FReferenceSkeleton::*)() const>);
FACT("Engine/Public/ReferenceSkeleton.h", "assumed",
     Is<decltype(&FReferenceSkeleton::GetBoneName), FName (FReferenceSkeleton::*)(int32) const>);
FACT("Engine/Public/ReferenceSkeleton.h", "assumed",
     Is<decltype(&FReferenceSkeleton::GetParentIndex), int32 (FReferenceSkeleton::*)(int32) const>);
FACT("Engine/Classes/Engine/SkeletalMesh.h", "old and new",
     Is<decltype(&USkeletalMesh::GetRefSkeleton), const FReferenceSkeleton& (USkeletalMesh::*)() const>);
FACT("Engine/Classes/Kismet/BlueprintAsyncActionBase.h", "old and new",
     Is<decltype(&UBlueprintAsyncActionBase::Activate), void (UBlueprintAsyncActionBase::*)()>);
FACT("Engine/Classes/Kismet/BlueprintAsyncActionBase.h", "old and new",
     Is<decltype(&UBlueprintAsyncActionBase::SetReadyToDestroy), void (UBlueprintAsyncActionBase::*)()>);
