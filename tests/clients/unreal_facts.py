"""What the Unreal plugin assumes about Unreal's API, as signatures of the engine's public headers.

The engine's source is not public, so each fact says in which public copies of a header it was read: "older" than 5.3,
"5.4" (a branch of the engine between 5.3 and 5.5), "newer" than 5.6; "assumed" was read in none. With an engine's
source, a test looks all of them up there: `MANIPNET_UNREAL_SOURCE` names the folder that holds `Engine`. Export macros
and how much space is between words do not count.
"""

RUNTIME = "Engine/Source/Runtime"

FACTS = (
    ("LiveLinkInterface/Public/ILiveLinkSource.h", "older, newer", "ReceiveClient(ILiveLinkClient* InClient, FGuid"),
    ("LiveLinkInterface/Public/ILiveLinkSource.h", "older, newer", "virtual bool IsSourceStillValid() const"),
    ("LiveLinkInterface/Public/ILiveLinkSource.h", "older, newer", "virtual bool RequestSourceShutdown()"),
    ("LiveLinkInterface/Public/ILiveLinkSource.h", "older, newer", "virtual void Update()"),
    (
        "LiveLinkInterface/Public/ILiveLinkClient.h",
        "older, 5.4, newer",
        "void PushSubjectStaticData_AnyThread(const FLiveLinkSubjectKey& SubjectKey, TSubclassOf<ULiveLinkRole> Role, "
        "FLiveLinkStaticDataStruct&& StaticData)",
    ),
    (
        "LiveLinkInterface/Public/ILiveLinkClient.h",
        "older, 5.4, newer",
        "void PushSubjectFrameData_AnyThread(const FLiveLinkSubjectKey& SubjectKey, FLiveLinkFrameDataStruct&& "
        "FrameData)",
    ),
    ("LiveLinkInterface/Public/LiveLinkSourceSettings.h", "older, 5.4", "float EngineTimeOffset"),
    ("LiveLinkInterface/Public/LiveLinkSourceSettings.h", "older, 5.4", "FString ConnectionString;"),
    (
        "LiveLinkInterface/Public/LiveLinkSourceSettings.h",
        "older, 5.4",
        "FLiveLinkSourceBufferManagementSettings BufferSettings;",
    ),
    (
        "Core/Public/Misc/Timecode.h",
        "older, 5.4",
        "FTimecode(int32 InHours, int32 InMinutes, int32 InSeconds, int32 InFrames, bool InbDropFrame)",
    ),
    ("Core/Public/Misc/FrameRate.h", "assumed", "FFrameRate(uint32 InNumerator, uint32 InDenominator)"),
    (
        "LiveLinkAnimationCore/Public/LiveLinkRetargetAsset.h",
        "older",
        "virtual void BuildPoseFromAnimationData(float DeltaTime, const FLiveLinkSkeletonStaticData* InSkeletonData, "
        "const FLiveLinkAnimationFrameData* InFrameData, FCompactPose& OutPose)",
    ),
    ("Engine/Public/BoneContainer.h", "older", "const FReferenceSkeleton& GetReferenceSkeleton() const"),
    ("Engine/Public/ReferenceSkeleton.h", "older", "const TArray<FTransform> & GetRefBonePose() const"),
    ("Engine/Classes/Engine/SkeletalMesh.h", "older, newer", "const FReferenceSkeleton& GetRefSkeleton() const"),
    ("Engine/Classes/Kismet/BlueprintAsyncActionBase.h", "older, newer", "virtual void Activate();"),
    ("Engine/Classes/Kismet/BlueprintAsyncActionBase.h", "older, newer", "virtual void SetReadyToDestroy();"),
)
"""A header under `RUNTIME`, in which copies of it the fact was read, and the fact."""
